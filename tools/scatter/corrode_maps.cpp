#include "tools/scatter/corrode_maps.h"

#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <optional>
#include <string_view>
#include <vector>

#include "host_sdk/formats/file_bytes.h"
#include "host_sdk/images/decode_image.h"

namespace scatter::cli {
namespace {

/// The whole text as a number.
std::optional<float> number(std::string_view text) {
  float value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc{} && end == text.data() + text.size() ? std::optional(value) : std::nullopt;
}

std::vector<std::string_view> split(std::string_view text, char at) {
  std::vector<std::string_view> parts;
  for (auto end = text.find(at); end != std::string_view::npos; end = text.find(at)) {
    parts.push_back(text.substr(0, end));
    text.remove_prefix(end + 1);
  }
  parts.push_back(text);
  return parts;
}

Result<images::Image> read_image(const std::string& parameter, const std::string& path,
                                 images::Encoding encoding) {
  const auto named = [&parameter](Error error) {
    error.what = fmt::format("{}: {}", parameter, error.what);
    return std::unexpected(std::move(error));
  };
  const auto bytes = formats::read_file(path);
  if (!bytes) {
    return named(bytes.error());
  }
  auto image = images::decode_image(*bytes, path, encoding);
  if (!image) {
    return named(image.error());
  }
  for (std::size_t n = 0; n < image->values.size(); ++n) {
    if (!std::isfinite(image->values[n])) {
      const std::size_t pixel = n / image->channels;
      return fail(ErrorCode::kInvalidArgument,
                  fmt::format("{}: {}: column {}, row {} is {}, expected a finite number", parameter, path,
                              pixel % image->width, pixel / image->width, image->values[n]),
                  "repair the image");
    }
  }
  return image;
}

}  // namespace

Result<corrosion::Map> read_map(const std::string& parameter, const std::string& text) {
  if (const auto value = number(text)) {
    return corrosion::Map{1, 1, {*value}};
  }
  auto image = read_image(parameter, text, images::Encoding::kLinear);
  if (!image) {
    return std::unexpected(image.error());
  }
  images::Image grey = images::luminance(*image);
  return corrosion::Map{grey.width, grey.height, std::move(grey.values)};
}

Status take_map(const std::string& parameter, const std::string& text, corrosion::Map& to) {
  if (text.empty()) {
    return {};
  }
  auto map = read_map(parameter, text);
  if (!map) {
    return std::unexpected(map.error());
  }
  to = *std::move(map);
  return {};
}

Result<corrosion::ColourMap> read_layer(const std::string& parameter, const std::string& text) {
  if (const auto parts = split(text, '/'); parts.size() == 3) {
    const auto red = number(parts[0]);
    const auto green = number(parts[1]);
    const auto blue = number(parts[2]);
    if (red && green && blue) {
      return corrosion::ColourMap{1, 1, {corrosion::Rgb{*red, *green, *blue}}};
    }
  }
  const auto image = read_image(parameter, text, images::Encoding::kSrgb);
  if (!image) {
    return std::unexpected(image.error());
  }
  corrosion::ColourMap map{image->width, image->height, {}};
  map.values.reserve(image->pixels());
  for (std::size_t n = 0; n < image->pixels(); ++n) {
    const float* const pixel = &image->values[n * image->channels];
    map.values.push_back(image->channels == 1 ? corrosion::Rgb{pixel[0], pixel[0], pixel[0]}
                                              : corrosion::Rgb{pixel[0], pixel[1], pixel[2]});
  }
  return map;
}

}  // namespace scatter::cli
