// Diffuse reflection of rough surfaces: the qualitative model of Oren and Nayar 1994.
#pragma once

#include <cmath>

#include "host_sdk/reflectance/models/formulas/geometry.h"

namespace scatter::reflectance::formulas {

/// sin(larger theta) tan(smaller theta) max(0, cos(phi_o - phi_i)); 0 where an azimuth is undefined.
[[nodiscard]] inline double oren_nayar_shape(const Geometry& g) noexcept {
  // sin(max) tan(min) = sin_i sin_o / cos(min theta), and cos(min theta) is the larger cosine.
  const double larger_cos = g.cos_i > g.cos_o ? g.cos_i : g.cos_o;
  return g.tangent_dot > 0 ? g.tangent_dot / larger_cos : 0.0;
}

/// (A + B shape) / pi [1/sr]: multiply by the albedo of the facets. Reciprocal; sigma = 0 is Lambert.
/// Range   sigma [rad] >= 0: standard deviation of the facets' slope angle.
/// Source  Oren and Nayar 1994, eq. 30 (without the term for mutual reflection).
template <typename T>
[[nodiscard]] T oren_nayar(const T& sigma, const Geometry& g) {
  const T s2 = sigma * sigma;
  const T a = 1.0 - 0.5 * s2 / (s2 + 0.33);
  const T b = 0.45 * s2 / (s2 + 0.09);
  return (a + b * oren_nayar_shape(g)) / kPi;
}

}  // namespace scatter::reflectance::formulas
