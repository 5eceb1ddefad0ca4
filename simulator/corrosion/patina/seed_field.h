// Rates of steady thickening: drawn at scattered seeds, interpolated between them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace scatter::corrosion {

/// A field of local growth rates over a piece that tiles, the same continuous field on every grid.
struct SeedField {
  double extent_mm = 50;  ///< Side of the piece.
  double spacing_mm = 6;  ///< Mean distance of the seeds of the coarsest scale, up to the extent.
  std::uint32_t scales =
      4;                ///< Each has seeds half as far apart, and half the sigma of the one before it, 1..8.
  double sigma = 0.35;  ///< Standard deviation of the logarithm of the coarsest scale's values, >= 0.
  std::uint64_t seed = 1;
};

/// Values > 0 with mean 1 over the grid; all 1 for sigma 0.
///
/// Quantity  product over the scales of values drawn log-normal at one place in each square of the scale's
/// lattice,
///           and interpolated from the seeds around with weights ((R - d) / (R d))^2, R = 2 lattice squares:
///           exact at the seeds, nowhere outside their values, without a seam.
/// Shape     result[y * side + x], first row at the top.
/// Source    Dorsey and Hanrahan 1996, section 3.2 (steady thickening); the weights of Franke and Little 1980
/// in
///           Shepard's interpolation.
/// Cost      25 seeds per cell and scale; scales finer than 2 cells are left out.
[[nodiscard]] std::vector<float> on_grid(const SeedField& field, std::size_t side);

}  // namespace scatter::corrosion
