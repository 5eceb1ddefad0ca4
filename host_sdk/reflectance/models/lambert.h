// The ideal diffuse reflector.
#pragma once

#include "host_sdk/reflectance/brdf.h"
#include "host_sdk/reflectance/models/model_channels.h"

namespace scatter::reflectance {

/// f = albedo / pi [1/sr] in the upper hemisphere. Implements `Brdf`; reciprocal, energy = albedo.
class Lambert final : public Brdf {
 public:
  /// Range  albedo 0..1 per channel (checked by make_model, not here).
  explicit Lambert(const ChannelValues& albedo) noexcept : albedo_(albedo) {}

  [[nodiscard]] const ChannelValues& albedo() const noexcept { return albedo_; }

  [[nodiscard]] ScatterType type() const noexcept override { return ScatterType::kBrdf; }
  [[nodiscard]] std::size_t channels() const noexcept override { return kModelChannels; }
  [[nodiscard]] std::span<const float> wavelengths_nm() const noexcept override {
    return kModelWavelengthsNm;
  }
  [[nodiscard]] Origin eval(const Direction& omega_i, const Direction& omega_o,
                            std::span<double> f_per_sr) const noexcept override;

 private:
  ChannelValues albedo_;
};

}  // namespace scatter::reflectance
