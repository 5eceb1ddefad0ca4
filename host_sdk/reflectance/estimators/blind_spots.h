// Holes in a grid, where the instrument could not see: filled and marked.
#pragma once

#include <cstddef>
#include <memory>

#include "host_sdk/error/error.h"
#include "host_sdk/reflectance/brdf.h"
#include "host_sdk/reflectance/grid_brdf.h"

namespace scatter::reflectance {

/// A grid without holes, as far as they could be filled; metadata key "blind_spots" says what was done.
struct FilledGrid {
  GridBrdf grid;
  std::size_t by_reciprocity = 0;  ///< Nodes.
  std::size_t by_neighbors = 0;
  std::size_t left = 0;  ///< In parts without any value, or with a single hole all over.
};

/// Gives every kInvalid node a value.
///
/// By reciprocity  f(omega_o, omega_i) where `reverse` (null: not wanted; the grid itself or a chain over it)
///           has it measured or interpolated. BRDF only.
/// By neighbours   the smooth surface over the rest of the hole: the solution of Laplace's equation on the
///           sphere with the values around the hole, which never leaves their range. Per part and channel.
/// Origin    kInterpolated; kExtrapolated for a hole that reaches the last row, where nothing bounds it.
/// Uncertainty  (when the part has them) systematic grows. By neighbours: the largest around the hole and, in
///           quadrature, the standard deviation of a uniform distribution over the range of the values
///           around it. By reciprocity: that of the value used and, likewise, half its distance from the
///           neighbours' surface.
/// Cost      conjugate gradients: about (hole's width in nodes) passes over the hole.
[[nodiscard]] Result<FilledGrid> fill_blind_spots(const GridBrdf& grid, const Brdf* reverse = nullptr);

}  // namespace scatter::reflectance
