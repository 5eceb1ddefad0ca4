// Pictures side by side, each with its caption.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "host_sdk/error/error.h"

namespace scatter::plot {

/// sRGB, red, green, blue, 8 bits each, first row at the top.
struct StripTile {
  std::size_t width = 0;
  std::size_t height = 0;
  std::vector<std::uint8_t> rgb;
  std::string caption;  ///< Under the picture.
};

/// At most ten tiles in a row, as many rows as it takes, all in cells of the largest tile's size; PNG.
/// Errors    kInvalidArgument: no tile, bytes that do not match a size, or a page of more than 20000 pixels a
/// side.
[[nodiscard]] Result<std::string> strip(std::span<const StripTile> tiles, const std::string& title);

}  // namespace scatter::plot
