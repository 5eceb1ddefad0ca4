// Powers of the cosine to the mirror direction: Phong 1975 and Lafortune and Willems 1994.
#pragma once

#include <cmath>

#include "host_sdk/reflectance/models/formulas/geometry.h"

namespace scatter::reflectance::formulas {

/// max(cos_mirror, 0)^n [1].
template <typename T>
[[nodiscard]] T mirror_power(const T& n, const Geometry& g) {
  using std::exp;
  if (!(g.cos_mirror > 0)) {
    return T(0.0);
  }
  return exp(n * std::log(g.cos_mirror));
}

/// (n + 2) / (2 pi) max(cos_mirror, 0)^n [1/sr]: reciprocal, albedo at most 1.
/// Range   n >= 0.
/// Source  Lafortune and Willems 1994, eq. 4.
template <typename T>
[[nodiscard]] T lafortune_phong_lobe(const T& n, const Geometry& g) {
  return (n + 2.0) / (2.0 * kPi) * mirror_power(n, g);
}

/// max(cos_mirror, 0)^n / cos_i: neither reciprocal nor bounded.
/// Source  Phong 1975, divided by the irradiance's cosine.
template <typename T>
[[nodiscard]] T phong_lobe(const T& n, const Geometry& g) {
  return mirror_power(n, g) / g.cos_i;
}

}  // namespace scatter::reflectance::formulas
