// Lobes of rough interfaces: GGX and Beckmann slopes with Smith's separable masking.
//
// A lobe here is D G1(i) G1(o) / (4 cos_i cos_o) [1/sr]: multiply it by a Fresnel term of cos_d.
#pragma once

#include <cmath>

#include "host_sdk/reflectance/models/formulas/geometry.h"

namespace scatter::reflectance::formulas {

/// D(h) of GGX [1/sr], normalised: its integral times cos_h over the hemisphere is 1.
/// Range   alpha > 0; sin2_h + cos_h^2 = 1.
/// Source  Walter 2007, eq. 33.
template <typename T>
[[nodiscard]] T ggx_distribution(const T& alpha, double cos_h, double sin2_h) {
  const T a2 = alpha * alpha;
  const T d = a2 * (cos_h * cos_h) + sin2_h;
  return a2 / (kPi * d * d);
}

/// The same with a roughness for each axis.
/// Source  Burley 2012, appendix B.
template <typename T>
[[nodiscard]] T ggx_distribution(const T& alpha_x, const T& alpha_y, const Direction& h) {
  const T x = h.x / alpha_x;
  const T y = h.y / alpha_y;
  const T d = x * x + y * y + h.z * h.z;
  return 1.0 / (kPi * alpha_x * alpha_y * d * d);
}

/// G1(w) / cos(w) of GGX: finite at grazing angles.
/// Source  Walter 2007, eq. 34.
template <typename T>
[[nodiscard]] T ggx_masking_over_cos(const T& alpha, double cos_theta) {
  using std::sqrt;
  const double cos2 = cos_theta * cos_theta;
  return 2.0 / (cos_theta + sqrt(cos2 + alpha * alpha * (1.0 - cos2)));
}

/// Source  Heitz 2014, eq. 85 and 86.
template <typename T>
[[nodiscard]] T ggx_masking_over_cos(const T& alpha_x, const T& alpha_y, const Direction& w) {
  using std::sqrt;
  const T x = alpha_x * w.x;
  const T y = alpha_y * w.y;
  return 2.0 / (w.z + sqrt(w.z * w.z + x * x + y * y));
}

/// Isotropic GGX lobe [1/sr], without Fresnel. Reciprocal.
template <typename T>
[[nodiscard]] T ggx_lobe(const T& alpha, const Geometry& g) {
  return ggx_distribution(alpha, g.cos_h, g.sin2_h) * ggx_masking_over_cos(alpha, g.cos_i) *
         ggx_masking_over_cos(alpha, g.cos_o) * 0.25;
}

/// Anisotropic GGX lobe [1/sr], without Fresnel. Reciprocal.
template <typename T>
[[nodiscard]] T ggx_lobe(const T& alpha_x, const T& alpha_y, const Geometry& g) {
  return ggx_distribution(alpha_x, alpha_y, g.h) * ggx_masking_over_cos(alpha_x, alpha_y, g.i) *
         ggx_masking_over_cos(alpha_x, alpha_y, g.o) * 0.25;
}

/// D(h) of Beckmann [1/sr], normalised (with the 1/pi that Cook and Torrance leave out).
/// Source  Walter 2007, eq. 25.
template <typename T>
[[nodiscard]] T beckmann_distribution(const T& alpha, double cos_h, double sin2_h) {
  using std::exp;
  const T a2 = alpha * alpha;
  const double cos2 = cos_h * cos_h;
  return exp(-(sin2_h / cos2) / a2) / (kPi * a2 * (cos2 * cos2));
}

/// G1(w) / cos(w) of Beckmann: the exact Smith integral, not Walter's rational fit to it, so that the
/// density of visible normals integrates to 1.
/// Source  Walter 2007, eq. 26.
template <typename T>
[[nodiscard]] T beckmann_masking_over_cos(const T& alpha, double cos_theta) {
  using std::erfc;
  using std::exp;
  using std::sqrt;
  const double sin_theta = std::sqrt(1.0 - cos_theta * cos_theta);
  const T slope = alpha * sin_theta;
  if (!(slope * 6.0 > cos_theta)) {
    return T(1.0 / cos_theta);  // Lambda < exp(-36): below double's resolution of 1.
  }
  const T a = cos_theta / slope;
  const double two_root_pi = 3.5449077018110320546;
  return 1.0 / (cos_theta + slope * exp(-(a * a)) / two_root_pi - 0.5 * cos_theta * erfc(a));
}

/// Beckmann lobe [1/sr], without Fresnel. Reciprocal.
template <typename T>
[[nodiscard]] T beckmann_lobe(const T& alpha, const Geometry& g) {
  return beckmann_distribution(alpha, g.cos_h, g.sin2_h) * beckmann_masking_over_cos(alpha, g.cos_i) *
         beckmann_masking_over_cos(alpha, g.cos_o) * 0.25;
}

}  // namespace scatter::reflectance::formulas
