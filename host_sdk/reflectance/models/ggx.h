// Rough surface with the GGX distribution over an optional Lambertian base.
#pragma once

#include "host_sdk/reflectance/brdf.h"
#include "host_sdk/reflectance/models/model_channels.h"

namespace scatter::reflectance {

/// f = F G D / (4 cos_i cos_o) + albedo / pi [1/sr]; Schlick Fresnel, separable Smith masking.
/// Implements `Brdf`; reciprocal. The two parts are simply added: albedo is that of the base
/// alone, and f0 + albedo near 1 makes more light than came in.
/// Source  Walter 2007, eq. 20, 33, 34; Schlick 1994.
class Ggx final : public Brdf {
 public:
  struct Parameters {
    ChannelValues alpha{0.2, 0.2, 0.2};  ///< Roughness, 0.001..1.
    ChannelValues f0{0.04, 0.04, 0.04};  ///< Reflectance at normal incidence, 0..1.
    ChannelValues albedo{0, 0, 0};       ///< Lambertian base, 0..1.
  };
  /// Ranges are checked by make_model, not here.
  explicit Ggx(const Parameters& parameters) noexcept : parameters_(parameters) {}

  [[nodiscard]] const Parameters& parameters() const noexcept { return parameters_; }

  [[nodiscard]] ScatterType type() const noexcept override { return ScatterType::kBrdf; }
  [[nodiscard]] std::size_t channels() const noexcept override { return kModelChannels; }
  [[nodiscard]] std::span<const float> wavelengths_nm() const noexcept override {
    return kModelWavelengthsNm;
  }
  [[nodiscard]] Origin eval(const Direction& omega_i, const Direction& omega_o,
                            std::span<double> f_per_sr) const noexcept override;
  void eval_batch(const Direction& omega_i, std::span<const Direction> omega_o, std::span<double> f_per_sr,
                  std::span<Origin> origin) const noexcept override;

 private:
  Parameters parameters_;
};

}  // namespace scatter::reflectance
