#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <initializer_list>
#include <optional>
#include <utility>

#include "host_sdk/formats/file_bytes.h"
#include "host_sdk/formats/rgl.h"
#include "host_sdk/formats/rgl_tensor.h"

namespace scatter::formats {
namespace {

using reflectance::AdaptiveBrdf;
using reflectance::BilinearTables;

constexpr std::string_view kMetadataPrefix = "scatter.";
constexpr const char* kRemedy = "download or export the file again";
static_assert(std::endian::native == std::endian::little, "the floats of the file are copied as they are");

/// Fields by name, with what a BRDF expects of them.
class Fields {
 public:
  /// The fields' data point into `file`.
  Fields(std::vector<TensorField> fields, FileBlock file, std::string_view file_name)
      : fields_(std::move(fields)), file_(std::move(file)), file_name_(file_name) {}

  [[nodiscard]] const std::vector<TensorField>& all() const { return fields_; }

  [[nodiscard]] const TensorField* find(std::string_view name) const {
    const auto at = std::ranges::find(fields_, name, &TensorField::name);
    return at == fields_.end() ? nullptr : &*at;
  }

  [[nodiscard]] std::unexpected<Error> bad(const std::string& what) const {
    return fail(ErrorCode::kInvalidArgument, fmt::format("{}: {}", file_name_, what), kRemedy);
  }

  /// The field, of this type and with these sizes; 0 in `shape` takes any size of at least 1.
  [[nodiscard]] Result<const TensorField*> get(std::string_view name, TensorType type,
                                               std::initializer_list<std::uint64_t> shape) const {
    const TensorField* field = find(name);
    if (field == nullptr) {
      return bad(fmt::format("byte {}: no field '{}' among the {} that the header names, expected {}",
                             kTensorHeader, name, fields_.size(), scatter::formats::name(type)));
    }
    const bool fits =
        field->type == type && std::ranges::equal(field->shape, shape, [](auto has, auto wanted) {
          return wanted == 0 ? has > 0 : has == wanted;
        });
    if (!fits) {
      std::string expected;
      for (const std::uint64_t size : shape) {
        expected +=
            fmt::format("{}{}", expected.empty() ? "" : ", ", size == 0 ? "n" : fmt::format("{}", size));
      }
      return bad(fmt::format("byte {}: field '{}' is {}, expected {}[{}]", field->offset, name, field->kind(),
                             scatter::formats::name(type), expected));
    }
    return field;
  }

  /// The byte that an error of AdaptiveBrdf speaks of: it names fields, this file is bytes.
  [[nodiscard]] std::unexpected<Error> located(Error error) const {
    for (const TensorField& field : fields_) {
      const bool luminance = field.name == "luminance";
      const bool spectra = field.name == "rgb" || field.name == "spectra";
      const bool table =
          luminance || spectra || field.name == "ndf" || field.name == "sigma" || field.name == "vndf";
      if (!table || field.type != TensorType::kF32) {
        continue;
      }
      for (std::size_t k = 0; k < field.data.size() / sizeof(float); ++k) {
        float value = 0;
        std::memcpy(&value, field.data.data() + k * sizeof(float), sizeof(float));
        if (!std::isfinite(value) || (value < 0 && !luminance && !spectra)) {
          return fail(ErrorCode::kInvalidArgument,
                      fmt::format("{}: byte {}: {}: value {} is {}, expected a finite number{}", file_name_,
                                  field.offset + k * sizeof(float), field.name, k, value,
                                  luminance || spectra ? "" : " of at least 0"),
                      kRemedy);
        }
      }
    }
    for (const TensorField& field : fields_) {
      if (error.what.starts_with(field.name)) {
        error.what = fmt::format("{}: byte {}: {}", file_name_, field.offset, error.what);
        return std::unexpected(std::move(error));
      }
    }
    error.what = fmt::format("{}: byte {}: {}", file_name_, kTensorHeader, error.what);
    return std::unexpected(std::move(error));
  }

  [[nodiscard]] Result<std::vector<float>> axis(std::string_view name) const {
    const auto field = get(name, TensorType::kF32, {0});
    if (!field) {
      return std::unexpected(field.error());
    }
    return floats(**field);
  }

  /// The last two sizes are those of one table.
  [[nodiscard]] Result<BilinearTables> tables(std::string_view name,
                                              std::initializer_list<std::uint64_t> shape) const {
    const auto field = get(name, TensorType::kF32, shape);
    if (!field) {
      return std::unexpected(field.error());
    }
    const auto& sizes = (*field)->shape;
    return BilinearTables{sizes[sizes.size() - 1], sizes[sizes.size() - 2], shared_floats(**field)};
  }

 private:
  static std::vector<float> floats(const TensorField& field) {
    std::vector<float> values(field.data.size() / sizeof(float));
    std::memcpy(values.data(), field.data.data(), field.data.size());
    return values;
  }

  /// Where they stand in the file, if they stand as floats do.
  [[nodiscard]] reflectance::SharedFloats shared_floats(const TensorField& field) const {
    if (field.offset % sizeof(float) != 0) {
      return floats(field);
    }
    return {file_.floats(),
            {file_.floats().get() + field.offset / sizeof(float), field.data.size() / sizeof(float)}};
  }

  std::vector<TensorField> fields_;
  FileBlock file_;
  std::string_view file_name_;
};

/// One bit per node, the first in the highest bit; nothing when the field is not of that size.
std::vector<std::uint8_t> unpack_bits(std::string_view bytes, std::size_t count) {
  if (bytes.size() != (count + 7) / 8) {
    return {};
  }
  std::vector<std::uint8_t> bits(bytes.size() * 8);
  std::uint8_t* out = bits.data();
  for (const char byte : bytes) {
    for (unsigned bit = 8; bit-- > 0;) {
      *out++ = static_cast<std::uint8_t>(static_cast<unsigned char>(byte) >> bit & 1U);
    }
  }
  bits.resize(count);
  return bits;
}

Result<AdaptiveBrdf> decode(FileBlock file, std::string_view name) {
  auto decoded = decode_tensor_file(file.bytes(), name);
  if (!decoded) {
    return std::unexpected(decoded.error());
  }
  const Fields fields(std::move(*decoded), std::move(file), name);
  AdaptiveBrdf::Content content;
  std::optional<Error> failed;
  const auto keep = [&failed](auto result, auto& out) {
    if (failed) {
      return;
    }
    if (result) {
      out = std::move(*result);
    } else {
      failed = result.error();
    }
  };
  keep(fields.axis("phi_i"), content.phi_i);
  keep(fields.axis("theta_i"), content.theta_i);
  const bool spectral = fields.find("spectra") != nullptr;
  if (spectral) {
    keep(fields.axis("wavelengths"), content.wavelengths_nm);
    content.channels = content.wavelengths_nm.size();
  } else if (!failed && fields.find("rgb") == nullptr) {
    return fields.bad(fmt::format(
        "byte {}: no field 'rgb' and no field 'spectra' in the header; it is a tensor file, but no BRDF",
        kTensorHeader));
  }
  const std::uint64_t phis = content.phi_i.size();
  const std::uint64_t thetas = content.theta_i.size();
  keep(fields.tables("ndf", {0, 0}), content.ndf);
  keep(fields.tables("sigma", {0, 0}), content.sigma);
  keep(fields.tables("vndf", {phis, thetas, 0, 0}), content.vndf);
  keep(fields.tables("luminance", {phis, thetas, 0, 0}), content.luminance);
  keep(fields.tables(spectral ? "spectra" : "rgb", {phis, thetas, content.channels, 0, 0}), content.spectra);
  const TensorField* jacobian = nullptr;
  keep(fields.get("jacobian", TensorType::kU8, {1}), jacobian);
  if (failed) {
    return std::unexpected(*failed);
  }
  content.jacobian = jacobian->data[0] != 0;
  if (const TensorField* description = fields.find("description"); description != nullptr) {
    if (description->type != TensorType::kU8 || description->shape.size() != 1) {
      return fields.bad(fmt::format("byte {}: field 'description' is {}, expected u8[n]", description->offset,
                                    description->kind()));
    }
    content.metadata["description"] = description->data;
  }
  if (const TensorField* valid = fields.find("valid"); valid != nullptr && valid->type == TensorType::kU8) {
    content.valid = unpack_bits(valid->data, content.luminance.values.size());
  }
  for (const TensorField& field : fields.all()) {
    if (field.name.starts_with(kMetadataPrefix) && field.type == TensorType::kU8) {
      content.metadata[field.name.substr(kMetadataPrefix.size())] = field.data;
    }
  }
  auto brdf = AdaptiveBrdf::make(std::move(content));
  if (!brdf) {
    return fields.located(std::move(brdf.error()));
  }
  return brdf;
}

}  // namespace

Result<AdaptiveBrdf> decode_rgl(std::string_view bytes, std::string_view name) {
  return decode(FileBlock(bytes), name);
}

Result<AdaptiveBrdf> read_rgl(const std::filesystem::path& path) {
  auto file = read_file_block(path);
  return file ? decode(std::move(*file), path.string()) : std::unexpected(file.error());
}

}  // namespace scatter::formats
