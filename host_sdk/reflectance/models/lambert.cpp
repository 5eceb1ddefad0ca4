#include "host_sdk/reflectance/models/lambert.h"

#include <algorithm>

namespace scatter::reflectance {

Origin Lambert::eval(const Direction& omega_i, const Direction& omega_o,
                     std::span<double> f_per_sr) const noexcept {
  if (!(omega_i.z > 0 && omega_o.z > 0)) {
    std::ranges::fill(f_per_sr, 0.0);
    return Origin::kInvalid;
  }
  for (std::size_t c = 0; c < kModelChannels; ++c) {
    f_per_sr[c] = albedo_[c] / kPi;
  }
  return Origin::kMeasured;
}

}  // namespace scatter::reflectance
