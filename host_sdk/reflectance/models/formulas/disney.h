// The parts of Burley's principled BRDF (Disney 2012); disney_brdf.h puts them together.
#pragma once

#include <cmath>

#include "host_sdk/reflectance/models/formulas/fresnel.h"
#include "host_sdk/reflectance/models/formulas/geometry.h"
#include "host_sdk/reflectance/models/formulas/microfacet.h"

namespace scatter::reflectance::formulas {

/// f_d without base colour and 1/pi: both directions' retro-reflective Schlick factors [1].
/// Range   roughness 0..1.
/// Source  Burley 2012, eq. 4.
template <typename T>
[[nodiscard]] T disney_diffuse(const T& roughness, const Geometry& g) {
  const T rise = roughness * (2.0 * g.cos_d * g.cos_d) - 0.5;  // F90 - 1
  return (1.0 + rise * schlick_weight(g.cos_i)) * (1.0 + rise * schlick_weight(g.cos_o));
}

/// What `subsurface` blends f_d with, after Hanrahan and Krueger, without base colour and 1/pi [1].
/// Source  Burley 2012, section 5.3 and its reference code.
template <typename T>
[[nodiscard]] T disney_subsurface(const T& roughness, const Geometry& g) {
  const T rise = roughness * (g.cos_d * g.cos_d) - 1.0;
  const T fss = (1.0 + rise * schlick_weight(g.cos_i)) * (1.0 + rise * schlick_weight(g.cos_o));
  return 1.25 * (fss * (1.0 / (g.cos_i + g.cos_o) - 0.5) + 0.5);
}

/// Roughness along and across x.
template <typename T>
struct DisneyAlpha {
  T x;
  T y;
};

/// roughness^2, stretched by `anisotropic`; at least 0.001.
/// Source  Burley 2012, section 5.4.
template <typename T>
[[nodiscard]] DisneyAlpha<T> disney_alpha(const T& roughness, const T& anisotropic) {
  using std::sqrt;
  const T aspect = sqrt(1.0 - 0.9 * anisotropic);
  DisneyAlpha<T> alpha{roughness * roughness / aspect, roughness * roughness * aspect};
  if (alpha.x < 0.001) {
    alpha.x = T(0.001);
  }
  if (alpha.y < 0.001) {
    alpha.y = T(0.001);
  }
  return alpha;
}

/// Primary specular lobe [1/sr], without Fresnel: GGX with the milder shadowing alpha
/// (0.5 + roughness / 2)^2. Reciprocal; not bounded by 1.
template <typename T>
[[nodiscard]] T disney_specular_lobe(const T& roughness, const T& anisotropic, const Geometry& g) {
  const DisneyAlpha<T> alpha = disney_alpha(roughness, anisotropic);
  const T half = 0.5 + 0.5 * roughness;
  const T shadowing = half * half;
  return ggx_distribution(alpha.x, alpha.y, g.h) * ggx_masking_over_cos(shadowing, g.cos_i) *
         ggx_masking_over_cos(shadowing, g.cos_o) * 0.25;
}

/// D of the clearcoat [1/sr]: "generalised Trowbridge-Reitz" with exponent 1, normalised.
/// Range   0 < alpha < 1.
/// Source  Burley 2012, eq. 4 of appendix B.
template <typename T>
[[nodiscard]] T gtr1_distribution(const T& alpha, double cos_h, double sin2_h) {
  using std::log;
  const T a2 = alpha * alpha;
  return (1.0 - a2) / (-kPi * log(a2) * (a2 * (cos_h * cos_h) + sin2_h));
}

/// Roughness of the clearcoat: 0.1 (gloss 0) .. 0.001 (gloss 1).
template <typename T>
[[nodiscard]] T disney_clearcoat_alpha(const T& gloss) {
  return 0.1 - 0.099 * gloss;
}

/// Clearcoat lobe at clearcoat = 1 [1/sr]: Fresnel (F0 0.04), shadowing (alpha 0.25) and the
/// strength 1/4 included. Reciprocal.
template <typename T>
[[nodiscard]] T disney_clearcoat_lobe(const T& gloss, const Geometry& g) {
  const T d = gtr1_distribution(disney_clearcoat_alpha(gloss), g.cos_h, g.sin2_h);
  return d * (0.25 * 0.25 * schlick_fresnel(0.04, g.cos_d) * ggx_masking_over_cos(0.25, g.cos_i) *
              ggx_masking_over_cos(0.25, g.cos_o));
}

}  // namespace scatter::reflectance::formulas
