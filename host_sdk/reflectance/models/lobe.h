// One summand of a model.
#pragma once

#include <cstddef>
#include <memory>
#include <span>

#include "host_sdk/reflectance/direction.h"
#include "host_sdk/reflectance/models/formulas/geometry.h"
#include "host_sdk/reflectance/models/model_channels.h"

namespace scatter::reflectance {

/// A reflection lobe with its Fresnel term and colour, and a way to draw directions from about it.
/// Immutable; every function may be called from any number of threads.
class Lobe {
 public:
  Lobe() = default;
  Lobe(const Lobe&) = delete;
  Lobe& operator=(const Lobe&) = delete;
  virtual ~Lobe() = default;

  /// f += weight * lobe [1/sr].
  virtual void add(const formulas::Geometry& g, const ChannelValues& weight,
                   std::span<double, kModelChannels> f_per_sr) const noexcept = 0;

  /// The same for many geometries. Shape: f_per_sr[k * kModelChannels + c].
  virtual void add_batch(std::span<const formulas::Geometry> g, const ChannelValues& weight,
                         std::span<double> f_per_sr) const noexcept = 0;

  /// About the albedo at omega_i, per channel: how often a sum of lobes should draw from this one.
  /// Positive wherever the lobe is.
  [[nodiscard]] virtual ChannelValues strength(const Direction& omega_i) const noexcept = 0;

  /// Draws a direction, perhaps below the surface. Range: omega_i.z > 0, u in [0, 1).
  [[nodiscard]] virtual Direction sample(const Direction& omega_i, double u1, double u2,
                                         double u3) const noexcept = 0;

  /// Density of `sample` over the sphere [1/sr]. Range: omega_i.z > 0.
  [[nodiscard]] virtual double pdf(const Direction& omega_i, const Direction& omega_o) const noexcept = 0;
};

/// `add` and `add_batch` from one inlined function: Derived has
/// `void value(const formulas::Geometry&, ChannelValues& out) const noexcept` [1/sr].
template <typename Derived>
class FormulaLobe : public Lobe {
 public:
  void add(const formulas::Geometry& g, const ChannelValues& weight,
           std::span<double, kModelChannels> f_per_sr) const noexcept final {
    ChannelValues value;
    static_cast<const Derived&>(*this).value(g, value);
    for (std::size_t c = 0; c < kModelChannels; ++c) {
      f_per_sr[c] += weight[c] * value[c];
    }
  }
  void add_batch(std::span<const formulas::Geometry> g, const ChannelValues& weight,
                 std::span<double> f_per_sr) const noexcept final {
    for (std::size_t k = 0; k < g.size(); ++k) {
      FormulaLobe::add(g[k], weight, f_per_sr.subspan(k * kModelChannels).template first<kModelChannels>());
    }
  }
};

}  // namespace scatter::reflectance
