#include "host_sdk/formats/rgl_tensor.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <optional>

namespace scatter::formats {
namespace {

using namespace std::string_view_literals;

constexpr std::string_view kMagic = "tensor_file\0"sv;
constexpr std::size_t kMostDimensions = 8;
constexpr std::size_t kLeastField = 13;  ///< Bytes of a field without name and dimensions.
constexpr std::size_t kAlignment = 8;
constexpr const char* kRemedy = "download or export the file again";

constexpr std::array<std::string_view, 12> kTypeNames{"?",   "u8",  "i8",  "u16", "i16", "u32",
                                                      "i32", "u64", "i64", "f16", "f32", "f64"};
constexpr std::array<std::uint64_t, 12> kTypeSizes{0, 1, 1, 2, 2, 4, 4, 8, 8, 2, 4, 8};

class Reader {
 public:
  Reader(std::string_view bytes, std::string_view file_name) : bytes_(bytes), file_name_(file_name) {}

  Result<std::vector<TensorField>> read() {
    if (!bytes_.starts_with(kMagic)) {
      return fail(ErrorCode::kInvalidArgument,
                  fmt::format("{}: byte 0: expected 'tensor_file' and a zero", file_name_),
                  "check that it is an RGL file");
    }
    if (bytes_.size() < kTensorHeader) {
      return fail(ErrorCode::kDataLoss,
                  fmt::format("{}: byte {}: the file ends in the header, which has {} bytes", file_name_,
                              bytes_.size(), kTensorHeader),
                  kRemedy);
    }
    at_ = kMagic.size();
    const std::uint64_t major = take(1);
    const std::uint64_t minor = take(1);
    if (major != 1) {
      return fail(ErrorCode::kVersionMismatch,
                  fmt::format("{}: byte 12: version {}.{}, expected 1.0", file_name_, major, minor),
                  "update this software");
    }
    const std::uint64_t count = take(4);
    if (count > (bytes_.size() - at_) / kLeastField) {
      return bad(fmt::format("{} fields in {} bytes", count, bytes_.size()));
    }
    std::vector<TensorField> fields;
    for (std::uint64_t k = 0; k < count; ++k) {
      if (Status status = field(fields); !status) {
        return std::unexpected(status.error());
      }
    }
    if (Status status = check_places(fields); !status) {
      return std::unexpected(status.error());
    }
    return fields;
  }

 private:
  [[nodiscard]] std::unexpected<Error> bad(const std::string& what) const {
    return fail(ErrorCode::kDataLoss, fmt::format("{}: byte {}: {}", file_name_, at_, what), kRemedy);
  }

  [[nodiscard]] bool has(std::uint64_t count) const { return count <= bytes_.size() - at_; }

  /// The caller has asked has().
  std::uint64_t take(std::size_t count) {
    std::uint64_t value = 0;
    for (std::size_t k = count; k-- > 0;) {
      value = value << 8 | static_cast<unsigned char>(bytes_[at_ + k]);
    }
    at_ += count;
    return value;
  }

  Status field(std::vector<TensorField>& fields) {
    const std::size_t start = at_;
    if (!has(2)) {
      return bad(
          fmt::format("the file ends at byte {}, expected the 2 bytes of the length of field {}'s name",
                      bytes_.size(), fields.size()));
    }
    const std::uint64_t length = take(2);
    if (!has(length + 11)) {
      return bad(fmt::format("a name of {} bytes, but only {} follow", length, bytes_.size() - at_));
    }
    TensorField field;
    for (const char c : bytes_.substr(at_, length)) {
      if (c < ' ' || c > '~') {
        return bad("a field's name that is not printable");
      }
      field.name += c;
    }
    at_ += length;
    const std::uint64_t dimensions = take(2);
    const std::uint64_t type = take(1);
    field.offset = take(8);
    if (type < 1 || type >= kTypeNames.size()) {
      return fail(ErrorCode::kInvalidArgument,
                  fmt::format("{}: byte {}: field '{}' has type {}, expected 1 to 11", file_name_, at_ - 9,
                              field.name, type),
                  kRemedy);
    }
    field.type = static_cast<TensorType>(type);
    if (dimensions > kMostDimensions || !has(8 * dimensions)) {
      return bad(fmt::format("field '{}' has {} dimensions, expected at most {} and {} bytes for them",
                             field.name, dimensions, kMostDimensions, 8 * dimensions));
    }
    std::uint64_t size = kTypeSizes[static_cast<std::size_t>(type)];
    for (std::uint64_t d = 0; d < dimensions; ++d) {
      field.shape.push_back(take(8));
      if (field.shape.back() != 0 && size > bytes_.size() / field.shape.back()) {
        return bad(fmt::format("field '{}' is {}, more than the file's {} bytes", field.name, field.kind(),
                               bytes_.size()));
      }
      size *= field.shape.back();
    }
    if (field.offset > bytes_.size() || size > bytes_.size() - field.offset) {
      return bad(fmt::format("field '{}' has {} bytes at byte {}, but the file ends at byte {}", field.name,
                             size, field.offset, bytes_.size()));
    }
    if (std::ranges::any_of(fields, [&](const TensorField& other) { return other.name == field.name; })) {
      return fail(ErrorCode::kInvalidArgument,
                  fmt::format("{}: byte {}: field '{}' comes a second time", file_name_, start, field.name),
                  kRemedy);
    }
    field.data = bytes_.substr(field.offset, size);
    fields.push_back(std::move(field));
    return {};
  }

  /// No field's data lie in the header or in another field's.
  Status check_places(const std::vector<TensorField>& fields) {
    std::vector<const TensorField*> by_offset;
    for (const TensorField& field : fields) {
      if (!field.data.empty()) {
        by_offset.push_back(&field);
      }
    }
    std::ranges::sort(by_offset, {}, &TensorField::offset);
    std::uint64_t end = at_;
    std::string_view before = "the header";
    for (const TensorField* field : by_offset) {
      if (field->offset < end) {
        return fail(ErrorCode::kDataLoss,
                    fmt::format("{}: byte {}: the data of field '{}' overlap {}, which ends at byte {}",
                                file_name_, field->offset, field->name, before, end),
                    kRemedy);
      }
      end = field->offset + field->data.size();
      before = field->name;
    }
    return {};
  }

  std::string_view bytes_;
  std::string_view file_name_;
  std::size_t at_ = 0;
};

void put(std::string& out, std::uint64_t value, std::size_t count) {
  for (std::size_t k = 0; k < count; ++k) {
    out += static_cast<char>(value >> (8 * k) & 0xFF);
  }
}

std::size_t aligned(std::size_t at) {
  return (at + kAlignment - 1) / kAlignment * kAlignment;
}

}  // namespace

std::string_view name(TensorType type) noexcept {
  return kTypeNames[static_cast<std::size_t>(type)];
}

std::string TensorField::kind() const {
  return fmt::format("{}[{}]", scatter::formats::name(type), fmt::join(shape, ", "));
}

Result<std::vector<TensorField>> decode_tensor_file(std::string_view bytes, std::string_view file_name) {
  return Reader(bytes, file_name).read();
}

std::string encode_tensor_file(const std::vector<TensorField>& fields) {
  std::size_t at = kTensorHeader;
  for (const TensorField& field : fields) {
    at += kLeastField + field.name.size() + 8 * field.shape.size();
  }
  std::string out(kMagic);
  put(out, 1, 1);
  put(out, 0, 1);
  put(out, fields.size(), 4);
  for (const TensorField& field : fields) {
    at = aligned(at);
    put(out, field.name.size(), 2);
    out += field.name;
    put(out, field.shape.size(), 2);
    put(out, static_cast<std::uint64_t>(field.type), 1);
    put(out, at, 8);
    for (const std::uint64_t size : field.shape) {
      put(out, size, 8);
    }
    at += field.data.size();
  }
  out.reserve(aligned(at));
  for (const TensorField& field : fields) {
    out.resize(aligned(out.size()), '\0');
    out += field.data;
  }
  return out;
}

}  // namespace scatter::formats
