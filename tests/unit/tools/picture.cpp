#include "tests/unit/tools/picture.h"

#include <catch2/catch.hpp>
#include <fstream>
#include <iterator>

#include "host_sdk/images/decode_image.h"
#include "host_sdk/images/exr_image.h"
#include "host_sdk/images/png_image.h"

namespace {

using scatter::images::Image;

Image to_image(const Picture& picture) {
  return {.width = picture.width,
          .height = picture.height,
          .channels = picture.channels,
          .values = picture.values};
}

}  // namespace

Picture picture(const std::filesystem::path& file, Numbers numbers) {
  std::ifstream stream(file, std::ios::binary);
  const std::string bytes{std::istreambuf_iterator<char>(stream), {}};
  using scatter::images::Encoding;
  const auto image = scatter::images::decode_image(
      bytes, file.string(), numbers == Numbers::kSrgb ? Encoding::kSrgb : Encoding::kLinear);
  REQUIRE(image.has_value());
  return {
      .width = image->width, .height = image->height, .channels = image->channels, .values = image->values};
}

void save_png(const std::filesystem::path& file, const Picture& picture) {
  std::ofstream(file, std::ios::binary)
      << *scatter::images::encode_png_image(to_image(picture), {.bits = 16});
}

void save_exr(const std::filesystem::path& file, const Picture& picture) {
  std::ofstream(file, std::ios::binary) << *scatter::images::encode_exr_image(to_image(picture));
}
