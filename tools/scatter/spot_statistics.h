// Several places of one sample: their mean, and how far they differ.
#pragma once

#include <array>
#include <optional>
#include <span>
#include <vector>

#include "host_sdk/error/error.h"
#include "host_sdk/measurement/process.h"
#include "host_sdk/reflectance/grid_brdf.h"

namespace scatter::cli {

/// One figure with its standard uncertainty, random and systematic parts together, as if all nodes were off
/// together: an upper bound.
struct SpotFigure {
  double value = 0;
  double uncertainty = 0;
};

/// Figures of one channel of one incidence. Peak: mean f [1/sr] over measured nodes within 2 deg of the
/// mirror direction; missing where the blind disc covers it. Diffuse: mean f over those farther than 45 deg
/// from it. Share: what leaves there, of the albedo. Albedo: over the measured region.
struct SpotFigures {
  std::optional<SpotFigure> peak, diffuse, share, albedo;
};

/// Of all channels of one part of a grid. BRDF or BTDF.
[[nodiscard]] std::vector<SpotFigures> spot_figures(const reflectance::GridBrdf& brdf, std::size_t part);

/// Over spots.
struct SpotSpread {
  double mean = 0;
  double deviation = 0;    ///< Standard deviation between spots (n - 1); 0 for one spot.
  double uncertainty = 0;  ///< Root mean square of the spots' own.
};
/// Missing when any spot has none.
[[nodiscard]] std::optional<SpotSpread> spread_of(std::span<const std::optional<SpotFigure>> spots);

/// Node by node, plain means: a spot with less noise does not count more. Where a spot has no value the
/// result has none; origins are the least trustworthy ones. Random uncertainties fall with the number of
/// spots, systematic ones (one calibration) do not. Errors    kInvalidArgument: none given, or different
/// grids.
struct SpotGrids {
  reflectance::GridBrdf mean;
  reflectance::GridBrdf deviation;  ///< f holds the standard deviation between spots [1/sr].
};
[[nodiscard]] Result<SpotGrids> combine_spots(std::span<const reflectance::GridBrdf* const> spots);

/// The measurement that stands for all: the mean grid, ledgers and times summed, and of every check the worst
/// row. Range: as many grids as measurements, at least one.
[[nodiscard]] measurement::Measurement mean_measurement(
    std::span<const measurement::Measurement* const> spots, reflectance::GridBrdf mean);

}  // namespace scatter::cli
