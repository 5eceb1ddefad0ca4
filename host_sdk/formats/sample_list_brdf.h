// Scattered samples as a Brdf that knows its samples and nothing between them.
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "host_sdk/error/error.h"
#include "host_sdk/reflectance/brdf.h"
#include "host_sdk/reflectance/scattered_samples.h"

namespace scatter::formats {

/// What a file without a grid opens as. Estimators (reflectance/estimators) take `samples()` and
/// answer between them.
class SampleListBrdf final : public reflectance::Brdf {
 public:
  /// Errors  those of reflectance::check; kInvalidArgument: no samples.
  [[nodiscard]] static Result<SampleListBrdf> make(reflectance::ScatteredSamples samples);

  [[nodiscard]] const reflectance::ScatteredSamples& samples() const noexcept { return samples_; }

  [[nodiscard]] reflectance::ScatterType type() const noexcept override { return samples_.type; }
  [[nodiscard]] std::size_t channels() const noexcept override { return samples_.channels; }
  [[nodiscard]] std::span<const float> wavelengths_nm() const noexcept override {
    return samples_.wavelengths_nm;
  }
  /// Of the samples with a value, as `incidences_of`.
  [[nodiscard]] std::vector<reflectance::Direction> own_incidences() const override {
    return incidences_of(samples_);
  }
  /// The first sample within 1e-5 rad in both directions; kInvalid where there is none.
  [[nodiscard]] reflectance::Origin eval(const reflectance::Direction& omega_i,
                                         const reflectance::Direction& omega_o,
                                         std::span<double> f_per_sr) const noexcept override;
  [[nodiscard]] bool uncertainty(const reflectance::Direction& omega_i, const reflectance::Direction& omega_o,
                                 std::span<double> random_per_sr,
                                 std::span<double> systematic_per_sr) const noexcept override;

 private:
  explicit SampleListBrdf(reflectance::ScatteredSamples samples);
  /// Index of the sample, or samples().size().
  [[nodiscard]] std::size_t find(const reflectance::Direction& omega_i,
                                 const reflectance::Direction& omega_o) const noexcept;

  reflectance::ScatteredSamples samples_;
  std::vector<std::pair<double, std::uint32_t>> by_key_;  ///< A projection of the pair, ascending.
};

}  // namespace scatter::formats
