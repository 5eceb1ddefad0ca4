// Random fields that are the same on every grid.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace scatter::corrosion {

/// How a Gaussian field varies over the plane: isotropic, power per area of frequency
///   S(f) = C (1 + (2 pi f length)^2)^-(1 + roughness)   for 2 pi f finest < 1, nothing beyond,
/// with C so that the variance on an infinite plane is 1 (Matern's covariance, cut off; roughness 1/2 without
/// the cut is exp(-r / length)).
struct FieldSpectrum {
  double length_mm = 1;    ///< Correlation length, > 0.
  double roughness = 0.5;  ///< Exponent nu of Matern's covariance, > 0: small is ragged, 1.5 is smooth.
  double finest_mm = 0;    ///< Shortest scale, > 0.
};

/// Two independent fields on a grid of side x side cells, at the middles of the cells, row major.
struct FieldPair {
  std::array<std::vector<float>, 2> values;
  /// Expected variance: 1 less what is left out below and what is longer than the sheet.
  std::array<double, 2> variance{};
};

/// Draws both fields as sums of the sheet's Fourier modes, without its mean: they join at opposite borders.
///
/// The amplitude of a mode depends on seed, field and mode number only, so another grid of the same extent
/// sees the same continuous field. Modes shorter than 2 cells are left out. Range     side 1..16384; both
/// spectra have the same finest_mm. Error     the shortest wave may carry 1.3 % of its amplitude at wrong
/// frequencies (cubic spline between
///           at least three samples per wave), a wave twice as long 0.02 %.
/// Memory    up to 16 bytes per cell beyond the result while it runs.
/// Cost      about 30 ns per cell; one thread.
[[nodiscard]] FieldPair random_fields(std::uint64_t seed, std::size_t side, double extent_mm,
                                      const std::array<FieldSpectrum, 2>& spectra);

}  // namespace scatter::corrosion
