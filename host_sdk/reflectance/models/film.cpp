#include "host_sdk/reflectance/models/film.h"

#include <algorithm>

namespace scatter::reflectance {

Origin Film::eval(const Direction& omega_i, const Direction& omega_o,
                  std::span<double> f_per_sr) const noexcept {
  if (!(omega_i.z > 0 && omega_o.z < 0)) {
    std::ranges::fill(f_per_sr, 0.0);
    return Origin::kInvalid;
  }
  for (std::size_t c = 0; c < kModelChannels; ++c) {
    f_per_sr[c] = parameters_.transmittance[c] * parameters_.haze[c] / kPi;
  }
  return Origin::kMeasured;
}

bool Film::dirac(const Direction& omega_i, std::span<double> weight) const noexcept {
  if (!(omega_i.z > 0)) {
    return false;
  }
  for (std::size_t c = 0; c < kModelChannels; ++c) {
    weight[c] = parameters_.transmittance[c] * (1.0 - parameters_.haze[c]);
  }
  return true;
}

}  // namespace scatter::reflectance
