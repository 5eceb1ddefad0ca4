// The grid of cells: who touches whom, and what follows from it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "simulator/corrosion/growth_options.h"
#include "simulator/corrosion/sheet.h"

namespace scatter::corrosion {

/// Calls visit(cell) for each of the eight cells around `cell`; fewer at the border of a clamped grid. On a
/// toroidal one of side 8 or more they are all different.
template <typename Visit>
void visit_neighbours(std::uint32_t cell, std::uint32_t side, Border border, Visit&& visit) {
  const std::uint32_t x = cell % side;
  const std::uint32_t y = cell / side;
  const bool clamped = border == Border::kClamped;
  for (int dy = -1; dy <= 1; ++dy) {
    if (clamped && ((dy < 0 && y == 0) || (dy > 0 && y + 1 == side))) {
      continue;
    }
    const std::uint32_t row = (dy < 0   ? (y == 0 ? side : y) - 1
                               : dy > 0 ? (y + 1 == side ? 0 : y + 1)
                                        : y) *
                              side;
    for (int dx = -1; dx <= 1; ++dx) {
      if ((dx == 0 && dy == 0) || (clamped && ((dx < 0 && x == 0) || (dx > 0 && x + 1 == side)))) {
        continue;
      }
      visit(row + (dx < 0 ? (x == 0 ? side : x) - 1 : dx > 0 ? (x + 1 == side ? 0 : x + 1) : x));
    }
  }
}

/// 1 where the sheet was open from the start (options.opening below 0.5), else 0; empty when there is no such
/// cell.
[[nodiscard]] std::vector<std::uint8_t> openings_of(const GrowthOptions& options);

/// States of all cells from what has corroded.
///
/// Openings are holes from the start: they enclose (a corroded cell between rust and openings only deepens),
/// but do not threaten the metal beside them. Nothing lies beyond a clamped border: it encloses and does not
/// threaten either.
/// Shape     all side * side; opening may be empty (none). corroded and opening hold 0 and 1.
/// Cost      about 1 ns per cell; any number of threads.
void find_states(std::span<const std::uint8_t> corroded, std::span<const std::uint8_t> opening,
                 std::span<const float> height, std::span<const std::uint32_t> late_seeds_waiting,
                 std::size_t side, Border border, std::span<CellState> states);

/// Counts states and sums heights (float64, in order) into sheet's fractions and mass_loss_g_per_m2, which is
/// per area of what was metal. `opening` as above.
void account(std::span<const std::uint8_t> opening, Sheet& sheet);

}  // namespace scatter::corrosion
