// Light through a rough interface between two dielectrics.
#pragma once

#include "host_sdk/reflectance/models/model_channels.h"
#include "host_sdk/reflectance/models/sampled_brdf.h"

namespace scatter::reflectance {

/// BTDF of a rough interface with GGX slopes [1/sr]: |i.h| |o.h| / (cos_i |cos_o|) eta^2 (1 - F) G D
/// / (i.h + eta o.h)^2, h the facet normal that refracts omega_i into omega_o. Implements
/// `SampledBrdf`, by visible normals.
///
/// Reflection of the same interface: make_ggx_lobe with FacetFresnel::dielectric(eta); the two together
/// conserve energy up to what single scattering loses. Light from below is the model of 1 / eta, seen
/// upside down; reciprocity then reads f(i, o; eta) / eta^2 = f(o, i; 1 / eta).
/// Draws are lost where a facet reflects totally (eta < 1) and where it refracts upwards.
/// Source  Walter 2007, eq. 16, 17, 21.
class GgxTransmission final : public SampledBrdf {
 public:
  struct Parameters {
    ChannelValues alpha_x{0.2, 0.2, 0.2};  ///< Roughness, 0.001..1.
    ChannelValues alpha_y{0.2, 0.2, 0.2};
    ChannelValues eta{1.5, 1.5, 1.5};  ///< n below / n above, not 1 (light would go straight on).
  };
  /// Ranges are checked by make_model, not here.
  explicit GgxTransmission(const Parameters& parameters) noexcept;

  [[nodiscard]] const Parameters& parameters() const noexcept { return parameters_; }

  [[nodiscard]] ScatterType type() const noexcept override { return ScatterType::kBtdf; }
  [[nodiscard]] std::size_t channels() const noexcept override { return kModelChannels; }
  [[nodiscard]] std::span<const float> wavelengths_nm() const noexcept override {
    return kModelWavelengthsNm;
  }
  [[nodiscard]] Origin eval(const Direction& omega_i, const Direction& omega_o,
                            std::span<double> f_per_sr) const noexcept override;
  [[nodiscard]] DrawnDirection sample(const Direction& omega_i, const SampleInput& u,
                                      std::span<double> throughput) const noexcept override;
  [[nodiscard]] double pdf(const Direction& omega_i, const Direction& omega_o) const noexcept override;

 private:
  [[nodiscard]] double value(std::size_t c, const Direction& omega_i,
                             const Direction& omega_o) const noexcept;
  [[nodiscard]] double density(std::size_t c, const Direction& omega_i,
                               const Direction& omega_o) const noexcept;

  Parameters parameters_;
  bool same_;  ///< All channels alike.
};

}  // namespace scatter::reflectance
