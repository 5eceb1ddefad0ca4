// Which cells of a map lie in the light, and with what share.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "simulator/samples/sample.h"

namespace scatter::simulator {

/// One cell of a square map and its share of the light.
struct LitCell {
  std::uint32_t cell = 0;  ///< Row * side + column, first row at the top.
  double weight = 0;       ///< Sums to 1 over a spot.
};

/// Cells under an evenly lit ellipse: `diameter_mm` across the plane of incidence, 1/cos(theta_i) times that
/// along it. Cells on its edge count with the part that is inside. The map repeats beyond its borders (a cell
/// is then listed once for every time it is lit).
/// Range     side > 0, side^2 < 2^32, extent_mm > 0; x is to the right, y towards the first row;
///           cos(theta_i) below 0.01 counts as 0.01.
/// Cost      some ns per cell inside.
[[nodiscard]] std::vector<LitCell> lit_cells(std::size_t side, double extent_mm, const Place& middle,
                                             const Footprint& footprint);

/// Every cell, all alike.
[[nodiscard]] std::vector<LitCell> all_cells(std::size_t side);

}  // namespace scatter::simulator
