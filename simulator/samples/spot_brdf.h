// The BRDF of a spot whose facets lean every way and are not all of one material.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "host_sdk/reflectance/brdf.h"
#include "host_sdk/reflectance/models/model_channels.h"
#include "simulator/samples/facet_frame.h"

namespace scatter::simulator {

/// Sum over the facets of a height field [1/sr]:
///
///   f(wi, wo) = sum_k W_k (n_k.wi)+ (n_k.wo)+ / n_k.z * f_k(wi', wo') / (P(wi) P(wo))
///   P(w)      = max(w.z, sum_k W_k (n_k.w)+ / n_k.z)
///
/// W_k is the facet's share of the level area, f_k its material, primes mean its own frame. A facet of level
/// area 1 has the area 1 / n.z, which gives the numerator. P is cos(theta) as long as every facet faces w and
/// the slopes' mean is 0. Where facets turn away, those that remain would show more area than the spot has,
/// since none hides another in this sum: P then is the area that they show, which spreads the hiding evenly.
/// So f is reciprocal, and its albedo is at most that of its brightest material at every incidence.
/// Light that goes from facet to facet is left out.
///
/// Implements `Brdf`; three channels.
class SpotBrdf final : public reflectance::Brdf {
 public:
  struct Facet {
    double weight = 0;  ///< W_k; all sum to 1.
    reflectance::Direction normal{};
    double turn_rad = 0;  ///< Of the material's x axis about the normal, from the frame of facet_frame.h.
    /// Three channels, reflects; null for what scatters nothing (a hole).
    std::shared_ptr<const reflectance::Brdf> material{};
  };
  explicit SpotBrdf(std::span<const Facet> facets);

  [[nodiscard]] std::size_t facets() const noexcept { return facets_.size(); }

  [[nodiscard]] reflectance::ScatterType type() const noexcept override {
    return reflectance::ScatterType::kBrdf;
  }
  [[nodiscard]] std::size_t channels() const noexcept override { return reflectance::kModelChannels; }
  [[nodiscard]] std::span<const float> wavelengths_nm() const noexcept override {
    return reflectance::kModelWavelengthsNm;
  }
  [[nodiscard]] reflectance::Origin eval(const reflectance::Direction& omega_i,
                                         const reflectance::Direction& omega_o,
                                         std::span<double> f_per_sr) const noexcept override;
  void eval_batch(const reflectance::Direction& omega_i, std::span<const reflectance::Direction> omega_o,
                  std::span<double> f_per_sr, std::span<reflectance::Origin> origin) const noexcept override;

 private:
  struct Part {
    FacetFrame frame;
    double area = 0;  ///< W / n.z
    std::shared_ptr<const reflectance::Brdf> material;
  };
  [[nodiscard]] double shown(const reflectance::Direction& w) const noexcept;

  std::vector<Part> facets_;
};

}  // namespace scatter::simulator
