#include "host_sdk/reflectance/estimators/incidence_map.h"

#include <algorithm>

namespace scatter::reflectance {

Direction DistortedMap::operator()(const Direction& w) const noexcept {
  const double sin_theta = std::hypot(w.x, w.y);
  const double radius = std::atan2(sin_theta, std::max(w.z, 0.0)) / (kPi / 2);
  const double scale = sin_theta > 0 ? radius / sin_theta : 0.0;
  // From the mirror point, d = u - m and |d + c m| = c: (1 - m^2) c^2 - 2 (d.m) c - d^2 = 0.
  const double dx = w.x * scale - from_;
  const double dy = w.y * scale;
  const double a = 1 - from_ * from_;
  const double b = dx * from_;
  const double d_square = dx * dx + dy * dy;
  const double c = std::min((b + std::sqrt(b * b + a * d_square)) / a, 1.0);
  const double ux = dx + c * from_ + to_ * (1 - c);
  const double uy = dy;
  const double r = std::min(std::hypot(ux, uy), 1.0);
  if (r == 0) {
    return {0, 0, 1};
  }
  const double theta = r * (kPi / 2);
  const double s = std::sin(theta) / std::hypot(ux, uy);
  return {ux * s, uy * s, std::cos(theta)};
}

}  // namespace scatter::reflectance
