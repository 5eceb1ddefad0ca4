#include "host_sdk/reflectance/brdf.h"

namespace scatter::reflectance {

void Brdf::eval_batch(const Direction& omega_i, std::span<const Direction> omega_o,
                      std::span<double> f_per_sr, std::span<Origin> origin) const noexcept {
  const std::size_t n = channels();
  for (std::size_t k = 0; k < omega_o.size(); ++k) {
    const Origin from = eval(omega_i, omega_o[k], f_per_sr.subspan(k * n, n));
    if (!origin.empty()) {
      origin[k] = from;
    }
  }
}

void Brdf::eval_pairs(std::span<const Direction> omega_i, std::span<const Direction> omega_o,
                      std::span<double> f_per_sr, std::span<Origin> origin) const noexcept {
  const std::size_t n = channels();
  for (std::size_t k = 0; k < omega_o.size(); ++k) {
    const Origin from = eval(omega_i[k], omega_o[k], f_per_sr.subspan(k * n, n));
    if (!origin.empty()) {
      origin[k] = from;
    }
  }
}

}  // namespace scatter::reflectance
