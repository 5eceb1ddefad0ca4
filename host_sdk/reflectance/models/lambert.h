// The ideal diffuse reflector.
#pragma once

#include "host_sdk/reflectance/models/lobe_model.h"
#include "host_sdk/reflectance/models/model_channels.h"

namespace scatter::reflectance {

/// f = albedo / pi [1/sr] in the upper hemisphere. Implements `SampledBrdf`; reciprocal, energy = albedo.
class Lambert final : public LobeModel {
 public:
  /// Range  albedo 0..1 per channel (checked by make_model, not here).
  explicit Lambert(const ChannelValues& albedo);

  [[nodiscard]] const ChannelValues& albedo() const noexcept { return albedo_; }

 private:
  ChannelValues albedo_;
};

}  // namespace scatter::reflectance
