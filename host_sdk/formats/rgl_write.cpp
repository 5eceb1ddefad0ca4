#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <numeric>
#include <vector>

#include "host_sdk/formats/file_bytes.h"
#include "host_sdk/formats/rgl.h"
#include "host_sdk/formats/rgl_tensor.h"

namespace scatter::formats {
namespace {

using reflectance::AdaptiveBrdf;
using reflectance::AdaptOptions;
using reflectance::Brdf;

constexpr std::size_t kRgb = 3;
/// Keys of metadata end up in names of fields.
constexpr std::size_t kLongestKey = 200;

std::string_view bytes_of(std::span<const float> values) {
  return {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(float)};
}

/// As the reader's unpack_bits.
std::string pack_bits(const std::vector<std::uint8_t>& bits) {
  std::string out((bits.size() + 7) / 8, '\0');
  for (std::size_t k = 0; k < bits.size(); ++k) {
    out[k / 8] =
        static_cast<char>(static_cast<unsigned char>(out[k / 8]) | (bits[k] != 0 ? 0x80U >> (k % 8) : 0U));
  }
  return out;
}

/// Tables of `spectra` in another order of channels; one channel may be taken several times.
std::vector<float> channels_of(const AdaptiveBrdf::Content& content, const std::vector<std::size_t>& order) {
  const std::size_t size = content.spectra.size();
  const std::size_t slices = content.spectra.values.size() / size / content.channels;
  std::vector<float> out;
  out.reserve(slices * order.size() * size);
  for (std::size_t s = 0; s < slices; ++s) {
    for (const std::size_t c : order) {
      const auto from =
          content.spectra.values.begin() + static_cast<std::ptrdiff_t>((s * content.channels + c) * size);
      out.insert(out.end(), from, from + static_cast<std::ptrdiff_t>(size));
    }
  }
  return out;
}

Result<std::string> encode(const AdaptiveBrdf& brdf, const std::map<std::string, std::string>& metadata) {
  const AdaptiveBrdf::Content& content = brdf.content();
  std::vector<std::size_t> order(content.channels == 1 ? kRgb : content.channels);
  const bool spectral = order.size() != kRgb;
  if (content.channels > 1) {
    std::iota(order.begin(), order.end(), std::size_t{0});
  }
  std::vector<float> wavelengths;
  if (spectral) {
    if (content.wavelengths_nm.empty()) {
      return fail(ErrorCode::kInvalidArgument,
                  fmt::format("RGL: {} channels without wavelengths, expected 1 or 3, or wavelengths",
                              content.channels),
                  "choose the channels to write");
    }
    std::ranges::sort(order, {}, [&](std::size_t c) { return content.wavelengths_nm[c]; });
    for (const std::size_t c : order) {
      wavelengths.push_back(content.wavelengths_nm[c]);
    }
  }
  const std::vector<float> spectra = channels_of(content, order);
  const std::string valid = pack_bits(
      content.valid.empty() ? std::vector<std::uint8_t>(content.luminance.values.size(), 1) : content.valid);
  const std::string version("\1\0\0\0\0\0\0\0", 8);
  const std::string jacobian(1, content.jacobian ? '\1' : '\0');
  const auto described = metadata.find("description");
  const std::string description = described == metadata.end() ? "measured material" : described->second;
  const std::uint64_t phis = content.phi_i.size();
  const std::uint64_t thetas = content.theta_i.size();
  const auto table = [](std::string name, std::vector<std::uint64_t> shape, const auto& values) {
    return TensorField{std::move(name), TensorType::kF32, std::move(shape), 0,
                       bytes_of({values.data(), values.size()})};
  };
  const auto text = [](std::string name, const std::string& value) {
    return TensorField{std::move(name), TensorType::kU8, {value.size()}, 0, value};
  };
  const auto& vndf = brdf.vndf();
  const auto& luminance = content.luminance;
  std::vector<TensorField> fields{
      {"version", TensorType::kU32, {2}, 0, version},
      text("description", description),
      table("phi_i", {phis}, content.phi_i),
      table("theta_i", {thetas}, content.theta_i),
      table("sigma", {content.sigma.height, content.sigma.width}, content.sigma.values),
      table("ndf", {content.ndf.height, content.ndf.width}, content.ndf.values),
      table("vndf", {phis, thetas, vndf.height, vndf.width}, vndf.values),
      table("luminance", {phis, thetas, luminance.height, luminance.width}, luminance.values),
      table(spectral ? "spectra" : "rgb",
            {phis, thetas, order.size(), content.spectra.height, content.spectra.width}, spectra),
      text("jacobian", jacobian),
      text("valid", valid),
  };
  if (spectral) {
    fields.push_back(table("wavelengths", {wavelengths.size()}, wavelengths));
  }
  for (const auto& [key, value] : metadata) {
    const bool printable = std::ranges::all_of(key, [](char c) { return c >= ' ' && c <= '~'; });
    if (key != "description" && !key.empty() && key.size() <= kLongestKey && printable && !value.empty()) {
      fields.push_back(text(fmt::format("scatter.{}", key), value));
    }
  }
  return encode_tensor_file(fields);
}

}  // namespace

Result<std::string> encode_rgl(const Brdf& brdf, const AdaptOptions& options) {
  if (const auto* adaptive = dynamic_cast<const AdaptiveBrdf*>(&brdf)) {
    auto metadata = options.metadata;
    metadata.insert(adaptive->content().metadata.begin(), adaptive->content().metadata.end());
    return encode(*adaptive, metadata);
  }
  const auto adapted = reflectance::adapt(brdf, options);
  return adapted ? encode(*adapted, adapted->content().metadata) : std::unexpected(adapted.error());
}

Status write_rgl(const Brdf& brdf, const std::filesystem::path& path, const AdaptOptions& options) {
  const auto bytes = encode_rgl(brdf, options);
  return bytes ? write_file(path, *bytes) : std::unexpected(bytes.error());
}

}  // namespace scatter::formats
