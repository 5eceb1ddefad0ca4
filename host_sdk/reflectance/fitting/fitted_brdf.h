// A fitted model as a BRDF of any number of channels.
#pragma once

#include <memory>
#include <vector>

#include "host_sdk/reflectance/brdf.h"
#include "host_sdk/reflectance/fitting/fit_family.h"

namespace scatter::reflectance {

/// Base and lobes with their parameters. Implements `Brdf`; isotropic; values have origin kInterpolated.
/// Cost      one evaluation of each lobe for all channels together.
class FittedBrdf final : public Brdf {
 public:
  /// f_c = sum over terms j of coefficient[c * terms + j] * term_j(shape) + rest(shape).
  struct Parameters {
    FitFamily family = {};
    std::vector<double> shape = {};        ///< As shape_parameters(family) lists them.
    std::vector<double> coefficient = {};  ///< [channel * coefficients_per_channel(family) + term]
    std::size_t channels = 3;
    std::vector<float> wavelengths_nm = {};  ///< One per channel, or empty.
  };
  explicit FittedBrdf(Parameters parameters);

  [[nodiscard]] const Parameters& parameters() const noexcept { return parameters_; }

  [[nodiscard]] ScatterType type() const noexcept override { return ScatterType::kBrdf; }
  [[nodiscard]] std::size_t channels() const noexcept override { return parameters_.channels; }
  [[nodiscard]] std::span<const float> wavelengths_nm() const noexcept override {
    return parameters_.wavelengths_nm;
  }
  [[nodiscard]] Origin eval(const Direction& omega_i, const Direction& omega_o,
                            std::span<double> f_per_sr) const noexcept override;
  void eval_batch(const Direction& omega_i, std::span<const Direction> omega_o, std::span<double> f_per_sr,
                  std::span<Origin> origin) const noexcept override;

 private:
  Parameters parameters_;
};

}  // namespace scatter::reflectance
