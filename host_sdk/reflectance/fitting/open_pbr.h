// The base of the OpenPBR surface, for judging what an exported material will look like.
#pragma once

#include <vector>

#include "host_sdk/error/error.h"
#include "host_sdk/reflectance/brdf.h"
#include "host_sdk/reflectance/fitting/fit_samples.h"

namespace scatter::reflectance {

/// Metal and glossy-diffuse dielectric, mixed by metalness; coat, fuzz, transmission and the rest off,
/// specular_weight 1, base_diffuse_roughness 0. Implements `Brdf`.
///
/// f = metalness * F_metal * lobe + (1 - metalness) * (F * lobe + (1 - E(omega_o)) * base / pi) with GGX,
/// alpha = roughness^2, exact Fresnel F of the dielectric and Schlick's for the metal; E is the albedo
/// of F * lobe (layering by albedo scaling), so that f is not reciprocal.
/// Source  OpenPBR surface specification 1.1, "Base substrate" and "Layering".
class OpenPbr final : public Brdf {
 public:
  struct Parameters {
    std::vector<double> base_color = {};  ///< One per channel, 0..1.
    double metalness = 0;                 ///< 0..1
    double roughness = 0.3;               ///< 0.04..1
    double ior = 1.5;                     ///< 1..3
    std::vector<float> wavelengths_nm = {};
  };
  /// Cost      tabulates E: some milliseconds.
  explicit OpenPbr(Parameters parameters);

  [[nodiscard]] const Parameters& parameters() const noexcept { return parameters_; }

  /// The same with the base colour that fits samples best (log residual, by solid angle).
  /// Errors    check(samples); kInvalidArgument: other channels.
  [[nodiscard]] Result<OpenPbr> recoloured(const FitSamples& samples) const;

  [[nodiscard]] ScatterType type() const noexcept override { return ScatterType::kBrdf; }
  [[nodiscard]] std::size_t channels() const noexcept override { return parameters_.base_color.size(); }
  [[nodiscard]] std::span<const float> wavelengths_nm() const noexcept override {
    return parameters_.wavelengths_nm;
  }
  [[nodiscard]] Origin eval(const Direction& omega_i, const Direction& omega_o,
                            std::span<double> f_per_sr) const noexcept override;

 private:
  /// f = rest + base * factor.
  struct Terms {
    double rest = 0;
    double factor = 0;
  };
  [[nodiscard]] Terms terms(const Direction& omega_i, const Direction& omega_o) const noexcept;
  [[nodiscard]] double specular_albedo(double cos_theta) const noexcept;

  Parameters parameters_;
  std::vector<double> albedo_;  ///< E at even steps of the cosine, 0..1.
};

}  // namespace scatter::reflectance
