// One summand of a model.
#pragma once

#include <cstddef>
#include <memory>
#include <span>

#include "host_sdk/reflectance/direction.h"
#include "host_sdk/reflectance/models/formulas/geometry.h"
#include "host_sdk/reflectance/models/geometry_block.h"
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

  /// The same for every lane of a block.
  virtual void add_block(const GeometryBlock& block, const ChannelValues& weight,
                         BlockValues& sum) const noexcept = 0;

  /// About the albedo at omega_i, per channel: how often a sum of lobes should draw from this one.
  /// Positive wherever the lobe is.
  [[nodiscard]] virtual ChannelValues strength(const Direction& omega_i) const noexcept = 0;

  /// Draws a direction, perhaps below the surface. Range: omega_i.z > 0, u in [0, 1).
  [[nodiscard]] virtual Direction sample(const Direction& omega_i, double u1, double u2,
                                         double u3) const noexcept = 0;

  /// Density of `sample` over the sphere [1/sr]. Range: omega_i.z > 0.
  [[nodiscard]] virtual double pdf(const Direction& omega_i, const Direction& omega_o) const noexcept = 0;
};

/// `add` from a formula, and `add_block` lane by lane where no kernel does it: Derived has
/// `void value(const formulas::Geometry&, ChannelValues& out) const noexcept` [1/sr].
template <typename Derived, typename Base = Lobe>
class FormulaLobe : public Base {
 public:
  void add(const formulas::Geometry& g, const ChannelValues& weight,
           std::span<double, kModelChannels> f_per_sr) const noexcept final {
    ChannelValues value;
    static_cast<const Derived&>(*this).value(g, value);
    for (std::size_t c = 0; c < kModelChannels; ++c) {
      f_per_sr[c] += weight[c] * value[c];
    }
  }
  void add_block(const GeometryBlock& block, const ChannelValues& weight,
                 BlockValues& sum) const noexcept override {
    for (std::size_t k = 0; k < kBlockSize; ++k) {
      ChannelValues value;
      static_cast<const Derived&>(*this).value(block.at(k), value);
      for (std::size_t c = 0; c < kModelChannels; ++c) {
        sum.f_per_sr[c][k] += weight[c] * value[c];
      }
    }
  }

 private:
  friend Derived;
  FormulaLobe() = default;
};

}  // namespace scatter::reflectance
