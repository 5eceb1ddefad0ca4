// The top of a scattering lobe, located between nodes.
#pragma once

#include <optional>
#include <span>

#include "host_sdk/reflectance/direction.h"

namespace scatter::reflectance {

struct Peak {
  Direction at;  ///< Upper hemisphere, also for BTDF.
  double height_per_sr = 0;
  double radius = 0;  ///< Of the region that was fitted [rad].
};

/// Largest value of a smooth function given at nodes, refined by a quadratic fit over the nodes
/// above 80 % of it.
/// Shape     the three spans have one element per node; value NaN: the node does not count.
/// Range     radius > 0: fit over this radius [rad] instead, so that two peaks compare alike.
/// Returns   nothing when no lobe stands out: top below 1.5 times the median, top on the edge of
///           the nodes, or no maximum in the fit.
[[nodiscard]] std::optional<Peak> find_peak(std::span<const Direction> node,
                                            std::span<const double> solid_angle_sr,
                                            std::span<const double> value, double radius = 0);

}  // namespace scatter::reflectance
