#include "host_sdk/reflectance/models/sampled_brdf.h"

namespace scatter::reflectance {

void SampledBrdf::sample_batch(const Direction& omega_i, std::span<const SampleInput> u,
                               std::span<DrawnDirection> drawn, std::span<double> throughput) const noexcept {
  const std::size_t n = channels();
  for (std::size_t k = 0; k < u.size(); ++k) {
    drawn[k] = sample(omega_i, u[k], throughput.subspan(k * n, n));
  }
}

void SampledBrdf::pdf_batch(const Direction& omega_i, std::span<const Direction> omega_o,
                            std::span<double> density) const noexcept {
  for (std::size_t k = 0; k < omega_o.size(); ++k) {
    density[k] = pdf(omega_i, omega_o[k]);
  }
}

}  // namespace scatter::reflectance
