// What a measurement says twice, averaged: mirror halves, and exchanged directions.
#pragma once

#include <cstddef>

#include "host_sdk/error/error.h"
#include "host_sdk/reflectance/brdf.h"
#include "host_sdk/reflectance/grid_brdf.h"

namespace scatter::reflectance {

/// A grid after averaging; its metadata says so (keys "mirror_symmetry", "reciprocity").
struct AveragedGrid {
  GridBrdf grid;
  std::size_t averaged = 0;  ///< Nodes made from two values.
  std::size_t filled = 0;    ///< Nodes that had no value of their own.
};

/// Averages each node with its mirror image about the plane of incidence: for samples without a
/// preferred handedness. Where the image falls between columns it is interpolated linearly.
///
/// Origin    the worse of the two; a node without a value takes the image's, at least kInterpolated.
/// Uncertainty  random halves add in quadrature and halve; systematic ones are averaged. Nodes in the
///           plane of incidence are their own image and stay as they are.
/// Pixels    added.
[[nodiscard]] Result<AveragedGrid> average_mirror_halves(const GridBrdf& grid);

/// Averages each node with f(omega_o, omega_i), which Helmholtz makes equal: taken from `estimator` (the grid
/// itself, or a chain over it) where that is measured or interpolated, not extrapolated.
///
/// Weights   by the inverse of random^2 + systematic^2 when both values have uncertainties, else one half.
///           A value interpolated between incidences has an error that simple estimators do not know;
///           GuidedBrdf does.
/// Origin    the worse of the two; kInvalid nodes stay so (fill_blind_spots fills).
/// Errors    kInvalidArgument: transmission, whose reverse is another measurement; channels differ.
[[nodiscard]] Result<AveragedGrid> average_reciprocal(const GridBrdf& grid, const Brdf& estimator);

}  // namespace scatter::reflectance
