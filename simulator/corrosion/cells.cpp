#include "simulator/corrosion/cells.h"

#include <algorithm>

namespace scatter::corrosion {
namespace {

/// Sum over the row above, this one and the one below, and over left, middle and right of each.
/// `wide` has side + 2 elements: the column sums with one more on either side.
class BlockSums {
 public:
  BlockSums(std::span<const std::uint8_t> values, std::size_t side, Border border, std::uint8_t beyond)
      : values_(values),
        side_(side),
        clamped_(border == Border::kClamped),
        outside_(side, beyond),
        wide_(side + 2) {
    beyond_column_ = static_cast<std::uint8_t>(3 * beyond);
  }

  /// sums[x] over the nine cells around (x, y), itself included.
  void row(std::size_t y, std::span<std::uint8_t> sums) {
    const std::uint8_t* const above = neighbour_row(y == 0, y == 0 ? side_ - 1 : y - 1);
    const std::uint8_t* const here = values_.data() + y * side_;
    const std::uint8_t* const below = neighbour_row(y + 1 == side_, y + 1 == side_ ? 0 : y + 1);
    std::uint8_t* const wide = wide_.data();
    for (std::size_t x = 0; x < side_; ++x) {
      wide[x + 1] = static_cast<std::uint8_t>(above[x] + here[x] + below[x]);
    }
    wide[0] = clamped_ ? beyond_column_ : wide[side_];
    wide[side_ + 1] = clamped_ ? beyond_column_ : wide[1];
    for (std::size_t x = 0; x < side_; ++x) {
      sums[x] = static_cast<std::uint8_t>(wide[x] + wide[x + 1] + wide[x + 2]);
    }
  }

 private:
  [[nodiscard]] const std::uint8_t* neighbour_row(bool beyond, std::size_t y) const {
    return beyond && clamped_ ? outside_.data() : values_.data() + y * side_;
  }

  std::span<const std::uint8_t> values_;
  std::size_t side_;
  bool clamped_;
  std::uint8_t beyond_column_;
  std::vector<std::uint8_t> outside_;
  std::vector<std::uint8_t> wide_;
};

}  // namespace

std::vector<std::uint8_t> openings_of(const GrowthOptions& options) {
  if (std::none_of(options.opening.values.begin(), options.opening.values.end(),
                   [](float value) { return value < 0.5F; })) {
    return {};
  }
  const std::vector<float> map = on_grid(options.opening, options.side);
  std::vector<std::uint8_t> result(map.size());
  bool any = false;
  for (std::size_t i = 0; i < map.size(); ++i) {
    result[i] = map[i] < 0.5F ? 1 : 0;
    any = any || result[i] != 0;
  }
  if (!any) {
    result.clear();
  }
  return result;
}

void find_states(std::span<const std::uint8_t> corroded, std::span<const std::uint8_t> opening,
                 std::span<const float> height, std::span<const std::uint32_t> late_seeds_waiting,
                 std::size_t side, Border border, std::span<CellState> states) {
  std::vector<std::uint8_t> gone;  // What encloses: corroded or open.
  if (!opening.empty()) {
    gone.resize(corroded.size());
    for (std::size_t i = 0; i < gone.size(); ++i) {
      gone[i] = corroded[i] | opening[i];
    }
  }
  BlockSums rust(corroded, side, border, 0);
  BlockSums enclosing(opening.empty() ? corroded : std::span<const std::uint8_t>(gone), side, border, 1);
  std::vector<std::uint8_t> touching(side);
  std::vector<std::uint8_t> enclosed(side);
  const std::vector<std::uint8_t> closed(opening.empty() ? side : 0, 0);
  for (std::size_t y = 0; y < side; ++y) {
    rust.row(y, touching);
    enclosing.row(y, enclosed);
    const std::uint8_t* const c = corroded.data() + y * side;
    const std::uint8_t* const o = opening.empty() ? closed.data() : opening.data() + y * side;
    const float* const h = height.data() + y * side;
    auto* const out = reinterpret_cast<std::uint8_t*>(states.data()) + y * side;
    for (std::size_t x = 0; x < side; ++x) {
      const std::uint8_t metal = touching[x] > 0 ? 1 : 0;
      const std::uint8_t rusty = enclosed[x] == 9 ? 3 : 2;
      const std::uint8_t state = c[x] != 0 ? rusty : metal;
      out[x] = ((o[x] != 0) | (h[x] <= 0.0F)) ? std::uint8_t{4} : state;
    }
  }
  for (const std::uint32_t cell : late_seeds_waiting) {
    states[cell] = std::max(states[cell], CellState::kThreatened);
  }
}

void account(std::span<const std::uint8_t> opening, Sheet& sheet) {
  std::size_t corroded = 0;
  std::size_t deepening = 0;
  std::size_t holes = 0;
  double left = 0;
  for (std::size_t y = 0; y < sheet.side; ++y) {
    // One sum per row: rounding stays far below 1e-12, and the loops vectorise over states.
    double row = 0;
    std::uint32_t counts[3] = {0, 0, 0};
    for (std::size_t i = y * sheet.side; i < (y + 1) * sheet.side; ++i) {
      row += static_cast<double>(sheet.height[i]);
      counts[0] += sheet.state[i] >= CellState::kSpreading ? 1U : 0U;
      counts[1] += sheet.state[i] == CellState::kDeepening ? 1U : 0U;
      counts[2] += sheet.state[i] == CellState::kHole ? 1U : 0U;
    }
    left += row;
    corroded += counts[0];
    deepening += counts[1];
    holes += counts[2];
  }
  const auto open = static_cast<std::size_t>(std::count(opening.begin(), opening.end(), std::uint8_t{1}));
  const std::size_t metal = sheet.cells() - open;
  const double share = metal > 0 ? 1 / static_cast<double>(metal) : 0;
  sheet.corroded_fraction = static_cast<double>(corroded - open) * share;
  sheet.state3_fraction = static_cast<double>(deepening) * share;
  sheet.hole_fraction = static_cast<double>(holes - open) * share;
  sheet.mass_loss_g_per_m2 = (static_cast<double>(metal) - left) * share * sheet.thickness_mm * 1000 *
                             kSteelGramsPerSquareMetrePerUm;
}

}  // namespace scatter::corrosion
