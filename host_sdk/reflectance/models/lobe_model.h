// Reflection models as sums of lobes.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "host_sdk/reflectance/models/lobe.h"
#include "host_sdk/reflectance/models/model_channels.h"
#include "host_sdk/reflectance/models/sampled_brdf.h"

namespace scatter::reflectance {

/// A lobe and its weight [1], per channel, >= 0.
struct WeightedLobe {
  std::shared_ptr<const Lobe> lobe;
  ChannelValues weight = uniform(1);
};

/// f = sum of weight * lobe [1/sr], plus a mirror that eval never shows (see Brdf::dirac).
/// Lobes are simply added: whether the sum reflects more light than comes in is up to the weights.
/// Draws choose a lobe by its strength, then draw from it; densities are those of the mixture.
/// Implements `SampledBrdf`; BRDF, three channels.
class LobeModel : public SampledBrdf {
 public:
  /// mirror: share of the power that leaves in the mirror direction [1], per channel, 0..1.
  explicit LobeModel(std::vector<WeightedLobe> lobes, const ChannelValues& mirror = {});

  [[nodiscard]] std::span<const WeightedLobe> lobes() const noexcept { return lobes_; }
  [[nodiscard]] const ChannelValues& mirror() const noexcept { return mirror_; }

  [[nodiscard]] ScatterType type() const noexcept override { return ScatterType::kBrdf; }
  [[nodiscard]] std::size_t channels() const noexcept override { return kModelChannels; }
  [[nodiscard]] std::span<const float> wavelengths_nm() const noexcept override {
    return kModelWavelengthsNm;
  }
  [[nodiscard]] Origin eval(const Direction& omega_i, const Direction& omega_o,
                            std::span<double> f_per_sr) const noexcept override;
  void eval_batch(const Direction& omega_i, std::span<const Direction> omega_o, std::span<double> f_per_sr,
                  std::span<Origin> origin) const noexcept override;
  [[nodiscard]] bool dirac(const Direction& omega_i, std::span<double> weight) const noexcept override;

  [[nodiscard]] DrawnDirection sample(const Direction& omega_i, const SampleInput& u,
                                      std::span<double> throughput) const noexcept override;
  [[nodiscard]] double pdf(const Direction& omega_i, const Direction& omega_o) const noexcept override;
  void pdf_batch(const Direction& omega_i, std::span<const Direction> omega_o,
                 std::span<double> density) const noexcept override;

 private:
  [[nodiscard]] double strength(const WeightedLobe& lobe, const Direction& omega_i) const noexcept;
  /// Of all lobes and the mirror.
  [[nodiscard]] double total_strength(const Direction& omega_i) const noexcept;

  std::vector<WeightedLobe> lobes_;
  ChannelValues mirror_;
  double mirror_strength_ = 0;
};

}  // namespace scatter::reflectance
