#include "host_sdk/reflectance/models/ggx.h"

#include <algorithm>
#include <cmath>

namespace scatter::reflectance {
namespace {

/// G1 / cos theta = 2 / (cos + sqrt(cos^2 + alpha^2 sin^2)): finite at grazing angles.
double masking_over_cos(double cos_theta, double alpha2) noexcept {
  return 2.0 / (cos_theta + std::sqrt(cos_theta * cos_theta + alpha2 * (1.0 - cos_theta * cos_theta)));
}

}  // namespace

Origin Ggx::eval(const Direction& omega_i, const Direction& omega_o,
                 std::span<double> f_per_sr) const noexcept {
  if (!(omega_i.z > 0 && omega_o.z > 0)) {
    std::ranges::fill(f_per_sr, 0.0);
    return Origin::kInvalid;
  }
  const Direction h = normalized({omega_i.x + omega_o.x, omega_i.y + omega_o.y, omega_i.z + omega_o.z});
  const double cos_d = std::clamp(dot(omega_i, h), 0.0, 1.0);
  const double m = 1.0 - cos_d;
  const double schlick = m * m * m * m * m;
  // 1 - cos^2 loses the narrow lobes' digits; the tangential components keep them.
  const double sin2_h = h.x * h.x + h.y * h.y;
  const double cos2_h = h.z * h.z;
  double alpha_done = -1;
  double lobe = 0;
  for (std::size_t c = 0; c < kModelChannels; ++c) {
    const double alpha = parameters_.alpha[c];
    if (alpha != alpha_done) {
      const double a2 = alpha * alpha;
      const double d = a2 * cos2_h + sin2_h;
      lobe = a2 / (kPi * d * d) * masking_over_cos(omega_i.z, a2) * masking_over_cos(omega_o.z, a2) / 4.0;
      alpha_done = alpha;
    }
    const double fresnel = parameters_.f0[c] + (1.0 - parameters_.f0[c]) * schlick;
    f_per_sr[c] = fresnel * lobe + parameters_.albedo[c] / kPi;
  }
  return Origin::kMeasured;
}

void Ggx::eval_batch(const Direction& omega_i, std::span<const Direction> omega_o, std::span<double> f_per_sr,
                     std::span<Origin> origin) const noexcept {
  // The class is final: this call is direct and inlines, unlike the one in Brdf::eval_batch.
  for (std::size_t k = 0; k < omega_o.size(); ++k) {
    const Origin from = Ggx::eval(omega_i, omega_o[k], f_per_sr.subspan(k * kModelChannels, kModelChannels));
    if (!origin.empty()) {
      origin[k] = from;
    }
  }
}

}  // namespace scatter::reflectance
