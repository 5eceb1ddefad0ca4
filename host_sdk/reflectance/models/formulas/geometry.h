// What every formula needs of one pair of directions, computed once.
#pragma once

#include "host_sdk/reflectance/direction.h"

namespace scatter::reflectance::formulas {

/// One reflection geometry; both directions above the surface (z > 0).
///
/// Formulas take their parameters first, as any scalar type T (double, ceres::Jet), and a Geometry
/// last: `ggx_lobe(T alpha, const Geometry& g)`. They are values of f or of a factor of it [1/sr],
/// without cosine.
struct Geometry {
  Direction i;             ///< Towards the light.
  Direction o;             ///< Towards the detector.
  Direction h;             ///< Half vector, unit.
  double cos_i = 1;        ///< i.z
  double cos_o = 1;        ///< o.z
  double cos_h = 1;        ///< h.z
  double sin2_h = 0;       ///< From the tangential components: narrow lobes keep their digits.
  double cos_d = 1;        ///< Between either direction and h.
  double cos_mirror = 1;   ///< Between o and the mirror direction of i; may be negative.
  double tangent_dot = 0;  ///< sin_i sin_o cos(phi_o - phi_i).
};

/// Range  unit vectors, i.z > 0 and o.z > 0 (not checked).
[[nodiscard]] inline Geometry make_geometry(const Direction& omega_i, const Direction& omega_o) noexcept {
  Geometry g;
  g.i = omega_i;
  g.o = omega_o;
  g.h = normalized({omega_i.x + omega_o.x, omega_i.y + omega_o.y, omega_i.z + omega_o.z});
  g.cos_i = omega_i.z;
  g.cos_o = omega_o.z;
  g.cos_h = g.h.z;
  g.sin2_h = g.h.x * g.h.x + g.h.y * g.h.y;
  const double cos_d = dot(omega_i, g.h);
  g.cos_d = cos_d < 1 ? cos_d : 1;
  g.tangent_dot = omega_i.x * omega_o.x + omega_i.y * omega_o.y;
  g.cos_mirror = omega_i.z * omega_o.z - g.tangent_dot;
  return g;
}

}  // namespace scatter::reflectance::formulas
