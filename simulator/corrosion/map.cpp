#include "simulator/corrosion/map.h"

#include <fmt/core.h>

#include <cmath>

namespace scatter::corrosion {
namespace {

/// The two samples of a row or column on either side of a cell's middle, and the share of the second.
struct Between {
  std::size_t first;
  std::size_t second;
  float share;
};

std::vector<Between> between(std::size_t samples, std::size_t side) {
  std::vector<Between> result(side);
  const auto count = static_cast<double>(samples);
  for (std::size_t i = 0; i < side; ++i) {
    const double at = (static_cast<double>(i) + 0.5) / static_cast<double>(side) * count - 0.5;
    const double below = std::floor(at);
    // Half a sample before the first one lies the last one.
    const std::size_t first = below < 0 ? samples - 1 : static_cast<std::size_t>(below);
    result[i] = {first, (first + 1) % samples, static_cast<float>(at - below)};
  }
  return result;
}

}  // namespace

std::vector<float> on_grid(const Map& map, std::size_t side) {
  if (map.values.size() == 1) {
    return std::vector<float>(side * side, map.values[0]);
  }
  std::vector<float> result(side * side);
  const std::vector<Between> columns = between(map.width, side);
  const std::vector<Between> rows = between(map.height, side);
  for (std::size_t y = 0; y < side; ++y) {
    const float* const above = map.values.data() + rows[y].first * map.width;
    const float* const below = map.values.data() + rows[y].second * map.width;
    const float down = rows[y].share;
    for (std::size_t x = 0; x < side; ++x) {
      const auto [left, right, share] = columns[x];
      const float upper = above[left] + share * (above[right] - above[left]);
      const float lower = below[left] + share * (below[right] - below[left]);
      result[y * side + x] = upper + down * (lower - upper);
    }
  }
  return result;
}

Status check(const Map& map, const char* parameter, float lowest, float highest) {
  if (map.width == 0 || map.height == 0 || map.values.size() / map.width != map.height ||
      map.values.size() % map.width != 0) {
    return fail(
        ErrorCode::kInvalidArgument,
        fmt::format("{}: {} x {} cells have {} values", parameter, map.width, map.height, map.values.size()),
        "give one value per cell, at least one cell");
  }
  for (std::size_t i = 0; i < map.values.size(); ++i) {
    const float value = map.values[i];
    // Written so that it is true for a NaN.
    if (!(value >= lowest && value <= highest)) {
      return fail(ErrorCode::kInvalidArgument,
                  fmt::format("{}: column {}, row {} is {}", parameter, i % map.width, i / map.width, value),
                  fmt::format("give values from {} to {}", lowest, highest));
    }
  }
  return {};
}

}  // namespace scatter::corrosion
