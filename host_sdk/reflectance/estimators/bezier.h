// Quadratic Bezier curves as functions of x.
#pragma once

#include <cmath>

namespace scatter::reflectance {

/// Curve parameter t at which a quadratic Bezier curve with the abscissas 0, middle and 1 passes x.
/// Range  middle and x in 0..1.
[[nodiscard]] inline double bezier_parameter(double x, double middle) noexcept {
  // x = 2 t (1 - t) middle + t^2, solved without cancellation.
  const double root = middle + std::sqrt(middle * middle + (1 - 2 * middle) * x);
  return root > 0 ? x / root : 0.0;
}

/// Ordinate at t.
[[nodiscard]] inline double bezier_value(double t, double y0, double y1, double y2) noexcept {
  return (1 - t) * (1 - t) * y0 + 2 * t * (1 - t) * y1 + t * t * y2;
}

}  // namespace scatter::reflectance
