#include "host_sdk/images/image.h"

#include <fmt/format.h>

#include <cmath>

namespace scatter::images {

float srgb_to_linear(float encoded) noexcept {
  return encoded <= 0.04045F ? encoded / 12.92F : std::pow((encoded + 0.055F) / 1.055F, 2.4F);
}

float linear_to_srgb(float linear) noexcept {
  return linear <= 0.0031308F ? linear * 12.92F : 1.055F * std::pow(linear, 1 / 2.4F) - 0.055F;
}

Image luminance(const Image& image) {
  if (image.channels < 3) {
    return image;
  }
  Image grey{.width = image.width, .height = image.height, .channels = 1, .values = {}};
  grey.values.resize(image.pixels());
  for (std::size_t n = 0; n < grey.values.size(); ++n) {
    const float* const rgb = &image.values[n * image.channels];
    grey.values[n] = 0.2126F * rgb[0] + 0.7152F * rgb[1] + 0.0722F * rgb[2];
  }
  return grey;
}

Status check(const Image& image) {
  if (image.width < 1 || image.height < 1 || image.width > kLongestSide || image.height > kLongestSide ||
      image.pixels() > kMostPixels) {
    return fail(ErrorCode::kInvalidArgument,
                fmt::format("an image of {} x {} pixels, expected 1..{} each and at most {} in all",
                            image.width, image.height, kLongestSide, kMostPixels),
                "choose a smaller image");
  }
  if (image.channels != 1 && image.channels != 3 && image.channels != 4) {
    return fail(ErrorCode::kInvalidArgument,
                fmt::format("an image of {} channels, expected 1, 3 or 4", image.channels),
                "keep grey, RGB or RGBA");
  }
  if (image.values.size() != image.pixels() * image.channels) {
    return fail(ErrorCode::kInvalidArgument,
                fmt::format("an image of {} values, expected {}", image.values.size(),
                            image.pixels() * image.channels),
                "give one value per pixel and channel");
  }
  return {};
}

}  // namespace scatter::images
