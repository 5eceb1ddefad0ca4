// A picture as numbers, and the two encodings that numbers have in files.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "host_sdk/error/error.h"

namespace scatter::images {

/// Sides beyond this are refused by every reader and writer.
inline constexpr std::size_t kLongestSide = 32768;
/// Pixels beyond this as well: 16384 x 16384.
inline constexpr std::size_t kMostPixels = std::size_t{1} << 28U;

/// Shape  values[(y * width + x) * channels + c], first row at the top.
struct Image {
  std::size_t width = 0;
  std::size_t height = 0;
  std::size_t channels = 1;  ///< 1 grey; 3 red, green, blue; 4 with alpha (opacity, not multiplied in).
  std::vector<float> values;

  [[nodiscard]] std::size_t pixels() const noexcept { return width * height; }
};

/// What the numbers in a PNG file stand for; OpenEXR holds linear numbers always.
enum class Encoding : std::uint8_t {
  kLinear,  ///< As stored: a map of heights, normals, shares.
  kSrgb,    ///< Colours for a screen: IEC 61966-2-1; alpha is linear all the same.
};

/// IEC 61966-2-1. Values beyond 0..1 go on as the formula says; negative ones as its straight part.
[[nodiscard]] float srgb_to_linear(float encoded) noexcept;
[[nodiscard]] float linear_to_srgb(float linear) noexcept;

/// One channel: of colours 0.2126 R + 0.7152 G + 0.0722 B (ITU-R BT.709), of grey itself. Alpha is left out.
[[nodiscard]] Image luminance(const Image& image);

/// Errors  kInvalidArgument: no pixels, too many, other than 1, 3 or 4 channels, or values of another count.
[[nodiscard]] Status check(const Image& image);

}  // namespace scatter::images
