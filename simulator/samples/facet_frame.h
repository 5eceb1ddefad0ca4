// The frame of a facet that leans, and how much of a facet light and camera see.
#pragma once

#include <array>

#include "host_sdk/reflectance/direction.h"

namespace scatter::simulator {

/// Rows are a facet's x, y and normal in the surface's frame.
using FacetFrame = std::array<reflectance::Direction, 3>;

/// The frame z = normal that is reached from the surface's by the smallest rotation.
/// Range  a unit vector with z > -1.
[[nodiscard]] constexpr FacetFrame facet_frame(const reflectance::Direction& normal) noexcept {
  const double k = 1.0 / (1.0 + normal.z);
  return {reflectance::Direction{1.0 - normal.x * normal.x * k, -normal.x * normal.y * k, -normal.x},
          reflectance::Direction{-normal.x * normal.y * k, 1.0 - normal.y * normal.y * k, -normal.y}, normal};
}

/// A direction of the surface's frame in the facet's.
[[nodiscard]] constexpr reflectance::Direction to_facet(const reflectance::Direction& w,
                                                        const FacetFrame& frame) noexcept {
  return {dot(w, frame[0]), dot(w, frame[1]), dot(w, frame[2])};
}

/// Normal of a height field z(x, y) with these slopes dz/dx and dz/dy.
[[nodiscard]] inline reflectance::Direction normal_of_slope(double slope_x, double slope_y) noexcept {
  return reflectance::normalized({-slope_x, -slope_y, 1.0});
}

}  // namespace scatter::simulator
