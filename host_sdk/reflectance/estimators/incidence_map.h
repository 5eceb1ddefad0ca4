// Which direction at one incidence corresponds to a direction at another.
#pragma once

#include "host_sdk/reflectance/direction.h"

namespace scatter::reflectance {

/// All functions: light in the plane y = 0 with x > 0, z towards the side that light leaves from, so
/// that the mirror (or straight) direction is (-sin theta_i, 0, cos theta_i).

/// Turned about y by theta_to - theta_from: keeps the angles about the mirror direction. The result
/// may lie below the horizon.
class SpecularTurn {
 public:
  SpecularTurn(double theta_from, double theta_to) noexcept
      : cos_(std::cos(theta_to - theta_from)), sin_(std::sin(theta_to - theta_from)) {}
  [[nodiscard]] Direction operator()(const Direction& w) const noexcept {
    return {w.x * cos_ - w.z * sin_, w.y, w.x * sin_ + w.z * cos_};
  }

 private:
  double cos_;
  double sin_;
};

/// Keeps (c, azimuth) of the distorted coordinates: on the disk where a direction lies at
/// theta / (pi/2) from the centre, u = m (1 - c) + c (cos a, sin a), with m the mirror direction's point.
/// Circles of equal c widen from the mirror point (c = 0) to the horizon (c = 1).
class DistortedMap {
 public:
  DistortedMap(double theta_from, double theta_to) noexcept
      : from_(-theta_from / (kPi / 2)), to_(-theta_to / (kPi / 2)) {}
  [[nodiscard]] Direction operator()(const Direction& w) const noexcept;

 private:
  double from_;  ///< m lies on the x axis.
  double to_;
};

}  // namespace scatter::reflectance
