// The lobe of Cook and Torrance 1982.
#pragma once

#include <algorithm>

#include "host_sdk/reflectance/models/formulas/microfacet.h"

namespace scatter::reflectance::formulas {

/// Masking and shadowing of V-shaped grooves, 0..1.
/// Source  Cook and Torrance 1982, section "Reflectance model", G.
[[nodiscard]] inline double groove_masking(const Geometry& g) noexcept {
  const double s = 2 * g.cos_h / g.cos_d;
  return std::min({1.0, s * g.cos_o, s * g.cos_i});
}

/// G D / (pi cos_i cos_o) [1/sr] with the paper's D = exp(-tan^2 theta_h / m^2) / (m^2 cos^4 theta_h):
/// multiply by a Fresnel term of cos_d. Reciprocal.
///
/// That D lacks the 1/pi of the normalised one and the lobe the 1/4 that the change from h to
/// omega_o asks for, so it is four times the energy-conserving lobe: weigh it with at most 1/4.
template <typename T>
[[nodiscard]] T cook_torrance_lobe(const T& m, const Geometry& g) {
  return beckmann_distribution(m, g.cos_h, g.sin2_h) * (groove_masking(g) / (g.cos_i * g.cos_o));
}

}  // namespace scatter::reflectance::formulas
