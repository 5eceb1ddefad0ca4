#include "simulator/corrosion/interpolation.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace scatter::corrosion {
namespace {

/// The four cells around a place and their weights.
struct Four {
  std::array<std::size_t, 4> cell;
  std::array<double, 4> weight;
};

struct Two {
  std::size_t low;
  std::size_t high;
  double share;  ///< Of the high one.
};

Two two(double share_of_extent, const Sheet& sheet) noexcept {
  const auto side = static_cast<double>(sheet.side);
  double share = share_of_extent;
  if (sheet.toroidal) {
    share -= std::floor(share);
  } else {
    share = std::clamp(share, 0.5 / side, 1 - 0.5 / side);
  }
  const double at = share * side - 0.5;
  const double floor = std::floor(at);
  const auto low = static_cast<std::size_t>(floor < 0 ? side - 1 : std::min(floor, side - 1));
  const std::size_t high = low + 1 < sheet.side ? low + 1 : (sheet.toroidal ? 0 : low);
  return {low, high, at - floor};
}

Four four(double u, double v, const Sheet& sheet) noexcept {
  const Two x = two(u, sheet);
  const Two y = two(v, sheet);
  const std::size_t side = sheet.side;
  return {
      .cell = {y.low * side + x.low, y.low * side + x.high, y.high * side + x.low, y.high * side + x.high},
      .weight = {(1 - x.share) * (1 - y.share), x.share * (1 - y.share), (1 - x.share) * y.share,
                 x.share * y.share}};
}

}  // namespace

Regime regime_of_height(float height) noexcept {
  return height >= kMetalFromHeight  ? Regime::kMetal
         : height >= kRustFromHeight ? Regime::kRust
                                     : Regime::kHole;
}

Place evaluate(const Sheet& sheet, const AppearanceOptions& options, double u, double v) noexcept {
  const Four around = four(u, v, sheet);
  double height = 0;
  double rust = 0;
  for (std::size_t k = 0; k < 4; ++k) {
    height += around.weight[k] * static_cast<double>(sheet.height[around.cell[k]]);
    rust += around.weight[k] * (sheet.state[around.cell[k]] >= CellState::kSpreading ? 1.0 : 0.0);
  }
  Place place;
  place.height = static_cast<float>(height);
  place.rust = static_cast<float>(rust);
  if (options.rule == LookRule::kByHeight) {
    place.regime = regime_of_height(place.height);
  } else {
    const auto nearest = std::max_element(around.weight.begin(), around.weight.end()) - around.weight.begin();
    const bool hole = sheet.state[around.cell[static_cast<std::size_t>(nearest)]] == CellState::kHole;
    place.regime = hole ? Regime::kHole : place.rust >= 0.5F ? Regime::kRust : Regime::kMetal;
  }
  place.albedo = colour(options, u, v, place.height,
                        static_cast<float>(sheet.thickness_mm * 1000 * (1 - height)), place.rust);
  return place;
}

}  // namespace scatter::corrosion
