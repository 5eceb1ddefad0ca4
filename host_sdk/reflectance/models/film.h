// A transmitting film that scatters part of the light.
#pragma once

#include "host_sdk/reflectance/models/model_channels.h"
#include "host_sdk/reflectance/models/sampled_brdf.h"

namespace scatter::reflectance {

/// BTDF of a hazy film: transmittance * haze / pi [1/sr], Lambertian below the surface, plus a
/// Dirac component of transmittance * (1 - haze) that goes straight on. Implements `SampledBrdf`.
class Film final : public SampledBrdf {
 public:
  struct Parameters {
    ChannelValues transmittance{0, 0, 0};  ///< Total, 0..1.
    ChannelValues haze{0, 0, 0};           ///< Scattered share of it, 0..1.
  };
  /// Ranges are checked by make_model, not here.
  explicit Film(const Parameters& parameters) noexcept : parameters_(parameters) {}

  [[nodiscard]] const Parameters& parameters() const noexcept { return parameters_; }

  [[nodiscard]] ScatterType type() const noexcept override { return ScatterType::kBtdf; }
  [[nodiscard]] std::size_t channels() const noexcept override { return kModelChannels; }
  [[nodiscard]] std::span<const float> wavelengths_nm() const noexcept override {
    return kModelWavelengthsNm;
  }
  [[nodiscard]] Origin eval(const Direction& omega_i, const Direction& omega_o,
                            std::span<double> f_per_sr) const noexcept override;
  [[nodiscard]] bool dirac(const Direction& omega_i, std::span<double> weight) const noexcept override;
  [[nodiscard]] DrawnDirection sample(const Direction& omega_i, const SampleInput& u,
                                      std::span<double> throughput) const noexcept override;
  [[nodiscard]] double pdf(const Direction& omega_i, const Direction& omega_o) const noexcept override;

 private:
  /// Probability that `sample` goes straight on: that share of the light, all channels together.
  [[nodiscard]] double straight_share() const noexcept;

  Parameters parameters_;
};

}  // namespace scatter::reflectance
