// Directions in the sample's tangent frame: z = surface normal, x along phi = 0, right-handed.
// Both directions of a scattering geometry are unit vectors that point away from the surface.
#pragma once

#include <cmath>
#include <numbers>

namespace scatter::reflectance {

inline constexpr double kPi = std::numbers::pi;

[[nodiscard]] constexpr double radians(double angle_deg) noexcept {
  return angle_deg * (kPi / 180.0);
}
[[nodiscard]] constexpr double degrees(double angle_rad) noexcept {
  return angle_rad * (180.0 / kPi);
}

/// Unit vector (or, during computation, any vector).
struct Direction {
  double x = 0;
  double y = 0;
  double z = 1;
};

[[nodiscard]] constexpr double dot(const Direction& a, const Direction& b) noexcept {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
[[nodiscard]] constexpr Direction cross(const Direction& a, const Direction& b) noexcept {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
[[nodiscard]] inline Direction normalized(const Direction& a) noexcept {
  const double s = 1.0 / std::sqrt(dot(a, a));
  return {a.x * s, a.y * s, a.z * s};
}

/// theta from the normal [rad], phi counter-clockwise from x seen from above [rad].
[[nodiscard]] inline Direction from_spherical(double theta, double phi) noexcept {
  const double s = std::sin(theta);
  return {s * std::cos(phi), s * std::sin(phi), std::cos(theta)};
}
/// [0, pi]; accurate near the pole.
[[nodiscard]] inline double theta_of(const Direction& w) noexcept {
  return std::atan2(std::hypot(w.x, w.y), w.z);
}
/// [0, 2 pi).
[[nodiscard]] inline double phi_of(const Direction& w) noexcept {
  const double phi = std::atan2(w.y, w.x);
  return phi < 0 ? phi + 2 * kPi : phi;
}
/// Angle between two unit vectors [rad]; accurate for small angles.
[[nodiscard]] inline double angle_between(const Direction& a, const Direction& b) noexcept {
  const Direction c = cross(a, b);
  return std::atan2(std::sqrt(dot(c, c)), dot(a, b));
}
/// Mirror direction of w about the normal: (theta, phi + pi).
[[nodiscard]] constexpr Direction mirrored(const Direction& w) noexcept {
  return {-w.x, -w.y, w.z};
}

}  // namespace scatter::reflectance
