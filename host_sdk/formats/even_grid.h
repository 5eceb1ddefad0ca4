// Nodes at uneven angles, or with some missing, as the even grid that GridBrdf wants. Internal to
// formats' readers.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "host_sdk/reflectance/grid_brdf.h"

namespace scatter::formats {

/// The coarsest even grid that has every given angle as a node.
struct EvenLayout {
  double theta_step_deg = 0;
  double phi_step_deg = 0;
  std::size_t theta_count = 0;  ///< From 0 to the last given angle.
  std::size_t phi_count = 0;    ///< A whole turn.
};

/// Angles ascend strictly, theta in 0..90, phi in 0..<360; taken as multiples of 0.0001 deg.
/// Nothing where they make no sensible grid: gaps wider than the given ones, fewer than one node in
/// twenty given, or a single theta.
[[nodiscard]] std::optional<EvenLayout> even_layout(std::span<const double> theta_deg,
                                                    std::span<const double> phi_deg, double widest_theta_deg,
                                                    double widest_phi_deg);

/// A part whose planes are [theta index * phi count + phi index] over the given angles, moved to the
/// layout made of them. Given nodes keep value and origin; between four valid ones lies their
/// bilinear mean, kInterpolated, with their uncertainties' mean; elsewhere kInvalid. At theta 0,
/// one direction, the mean of what is valid stands for all.
[[nodiscard]] reflectance::GridPart on_even_grid(const reflectance::GridPart& given,
                                                 std::span<const double> theta_deg,
                                                 std::span<const double> phi_deg, const EvenLayout& layout);

}  // namespace scatter::formats
