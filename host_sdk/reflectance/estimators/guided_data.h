// The measured values that guided interpolation works on: one table per stored incidence.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "host_sdk/error/error.h"
#include "host_sdk/reflectance/brdf.h"
#include "host_sdk/reflectance/fitting/fit_samples.h"

namespace scatter::reflectance {

/// Regular grid about the normal in the light's frame: light in the plane y = 0 with x > 0, z towards
/// the side that light leaves from. Node (j, i) lies at theta = j theta_step, phi = i phi_step.
struct GuidedGrid {
  std::size_t rows = 81;
  std::size_t columns = 360;
  double theta_step = radians(1.0);  ///< [rad]
  double phi_step = radians(1.0);    ///< [rad]; columns * phi_step = 2 pi.

  /// Corners of a cell and the shares of its far sides.
  struct Cell {
    std::uint32_t low = 0;        ///< Node (j, i).
    std::uint32_t low_next = 0;   ///< Node (j, i + 1).
    std::uint32_t high = 0;       ///< Node (j + 1, i).
    std::uint32_t high_next = 0;  ///< Node (j + 1, i + 1).
    float row_share = 0;          ///< Of the two high ones.
    float column_share = 0;       ///< Of the two next ones.
  };
  /// Cell of a direction; below the last row (also below the horizon) the last row counts.
  [[nodiscard]] Cell locate(const Direction& w) const noexcept;
  [[nodiscard]] std::size_t size() const noexcept { return rows * columns; }
  [[nodiscard]] Direction direction(std::size_t node) const noexcept;
  [[nodiscard]] double solid_angle_sr(std::size_t node) const noexcept;
};

/// Values at all stored incidences of one sample rotation.
struct GuidedData {
  GuidedGrid grid;
  ScatterType type = ScatterType::kBrdf;
  std::size_t channels = 3;
  std::vector<double> theta_i;  ///< Ascending [rad].
  double azimuth = 0;           ///< Of the light in the data [rad].
  /// The sample may be turned by 180 deg: incidence -theta is the one at theta, turned.
  bool isotropic = true;
  /// f [1/sr], [incidence][node * channels + channel]; where nothing was measured the nearest value
  /// that was.
  std::vector<std::vector<float>> f_per_sr;
  std::vector<std::vector<std::uint8_t>> measured;  ///< [incidence][node], 1 where it was.
  /// Values below it count as it where a logarithm is taken; one per channel [1/sr].
  std::vector<double> floor_per_sr;

  /// Direction of the light at a stored incidence, as `source` is asked.
  [[nodiscard]] Direction omega_i(std::size_t incidence) const noexcept;
  /// About `wanted` of the measured values of the incidences named, for fitting; BRDF only.
  [[nodiscard]] FitSamples samples(std::span<const std::size_t> incidences, std::size_t wanted) const;
};

/// Nodes farther from the normal than this are not used [rad]: real files hold there what a partly
/// covered detector saw, and the model carries on better than they do.
inline constexpr double kGuidedThetaTo = radians(80.0);

/// Asks `source` at the nodes of every incidence; extrapolated answers count as not measured.
/// Errors  kFailedPrecondition: an incidence without a measured value, a channel without a positive one.
[[nodiscard]] Result<GuidedData> gather_guided(const Brdf& source, const GuidedGrid& grid,
                                               std::span<const double> theta_i, double azimuth,
                                               bool isotropic);

}  // namespace scatter::reflectance
