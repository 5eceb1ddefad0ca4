// Rough surface with the GGX distribution over an optional Lambertian base.
#pragma once

#include <optional>
#include <span>

#include "host_sdk/reflectance/models/lobe_model.h"
#include "host_sdk/reflectance/models/model_channels.h"

namespace scatter::reflectance {

/// f = F G D / (4 cos_i cos_o) + albedo / pi [1/sr]; Schlick Fresnel, separable Smith masking.
/// Implements `SampledBrdf`; reciprocal. The two parts are simply added: albedo is that of the base
/// alone, and f0 + albedo near 1 makes more light than came in.
/// Source  Walter 2007, eq. 20, 33, 34; Schlick 1994.
class Ggx final : public LobeModel {
 public:
  struct Parameters {
    ChannelValues alpha{0.2, 0.2, 0.2};  ///< Roughness, 0.001..1.
    ChannelValues f0{0.04, 0.04, 0.04};  ///< Reflectance at normal incidence, 0..1.
    ChannelValues albedo{0, 0, 0};       ///< Lambertian base, 0..1.
    /// Roughness along y, when it differs; alpha is then the one along x.
    std::optional<ChannelValues> alpha_y{};
  };
  /// Ranges are checked by make_model, not here.
  explicit Ggx(const Parameters& parameters);

  [[nodiscard]] const Parameters& parameters() const noexcept { return parameters_; }

  /// The sum of the lobes in one piece: the model that photons meet most often.
  [[nodiscard]] Origin eval(const Direction& omega_i, const Direction& omega_o,
                            std::span<double> f_per_sr) const noexcept override;

 private:
  Parameters parameters_;
};

}  // namespace scatter::reflectance
