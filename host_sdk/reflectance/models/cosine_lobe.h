// Diffuse lobes, drawn by the cosine. Private to this folder.
#pragma once

#include "host_sdk/reflectance/models/lobe.h"
#include "host_sdk/reflectance/models/warp.h"

namespace scatter::reflectance {

class CosineLobe : public Lobe {
 public:
  [[nodiscard]] Direction sample(const Direction& omega_i, double u1, double u2,
                                 double u3) const noexcept final {
    (void)omega_i, (void)u3;
    return warp::cosine(u1, u2);
  }
  [[nodiscard]] double pdf(const Direction& omega_i, const Direction& omega_o) const noexcept final {
    (void)omega_i;
    return omega_o.z > 0 ? omega_o.z / kPi : 0.0;
  }
};

}  // namespace scatter::reflectance
