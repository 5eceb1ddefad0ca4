#include "simulator/corrosion/patina/kubelka_munk.h"

#include <cmath>

namespace scatter::corrosion {

LayerOptics layer_optics(double absorption_per_um, double scattering_per_um, double thickness_um) noexcept {
  const double K = absorption_per_um;
  const double S = scattering_per_um;
  if (thickness_um <= 0 || (K <= 0 && S <= 0)) {
    return {};
  }
  // beta = b S = sqrt((K + S)^2 - S^2), written so that little absorption does not cancel.
  const double beta = std::sqrt(K * (K + 2 * S));
  const double depth = beta * thickness_um;
  if (!(depth > 1e-12)) {
    // The limit of no absorption; what is left out is below the rounding of the general form.
    const double d = S * thickness_um;
    return std::isinf(d) ? LayerOptics{1, 0} : LayerOptics{d / (1 + d), 1 / (1 + d)};
  }
  const double absorbed_twice = -std::expm1(-2 * depth);
  const double denominator = (S + K) * absorbed_twice + beta * (2 - absorbed_twice);
  return {S * absorbed_twice / denominator, 2 * beta * std::exp(-depth) / denominator};
}

LayerOptics over(const LayerOptics& upper, const LayerOptics& lower) noexcept {
  const double remaining = 1 - upper.reflectance * lower.reflectance;
  if (remaining <= 0) {
    return {1, 0};
  }
  return {upper.reflectance + upper.transmittance * upper.transmittance * lower.reflectance / remaining,
          upper.transmittance * lower.transmittance / remaining};
}

double infinite_reflectance(double absorption_per_um, double scattering_per_um) noexcept {
  if (scattering_per_um <= 0) {
    return 0;
  }
  const double ratio = absorption_per_um / scattering_per_um;
  // 1 / (1 + r + sqrt(r^2 + 2 r)) equals the textbook form and keeps its digits for large r.
  return 1 / (1 + ratio + std::sqrt(ratio * (ratio + 2)));
}

}  // namespace scatter::corrosion
