// A grey map over the sheet: how vulnerable, of what metal, how exposed each place is.
#pragma once

#include <cstddef>
#include <vector>

#include "host_sdk/error/error.h"

namespace scatter::corrosion {

/// Values over the whole sheet, row major, first row at the top; one value is a constant.
/// Samples lie at the middles of the map's own cells; the map repeats beyond its borders.
struct Map {
  std::size_t width = 1;
  std::size_t height = 1;
  std::vector<float> values{0.5F};
};

/// The map seen on a grid of side x side cells, bilinear between its samples.
/// Shape     result[y * side + x].
[[nodiscard]] std::vector<float> on_grid(const Map& map, std::size_t side);

/// Errors    kInvalidArgument when sizes do not match, or a value is not finite or outside [lowest, highest]:
///           names `parameter`, the place, the value and the range.
[[nodiscard]] Status check(const Map& map, const char* parameter, float lowest, float highest);

}  // namespace scatter::corrosion
