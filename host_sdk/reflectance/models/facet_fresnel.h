// Fresnel terms of facets as inlined types, so that a lobe's loop holds no choice among them.
#pragma once

#include <memory>

#include "host_sdk/reflectance/models/block_kernels.h"
#include "host_sdk/reflectance/models/formulas/fresnel.h"
#include "host_sdk/reflectance/models/lobes.h"

namespace scatter::reflectance {

struct SchlickTerm {
  ChannelValues f0;
  void operator()(double cos_d, ChannelValues& out) const noexcept {
    const double weight = formulas::schlick_weight(cos_d);
    for (std::size_t c = 0; c < kModelChannels; ++c) {
      out[c] = f0[c] + (1.0 - f0[c]) * weight;
    }
  }
  void block(std::size_t c, const GeometryBlock& g, BlockArray& out) const noexcept {
    kernels::schlick_fresnel(f0[c], g, out);
  }
  [[nodiscard]] bool differs(std::size_t a, std::size_t b) const noexcept { return f0[a] != f0[b]; }
};

struct DielectricTerm {
  ChannelValues eta;
  void operator()(double cos_d, ChannelValues& out) const noexcept {
    for (std::size_t c = 0; c < kModelChannels; ++c) {
      out[c] = formulas::dielectric_fresnel(eta[c], cos_d);
    }
  }
  void block(std::size_t c, const GeometryBlock& g, BlockArray& out) const noexcept {
    kernels::dielectric_fresnel(eta[c], g, out);
  }
  [[nodiscard]] bool differs(std::size_t a, std::size_t b) const noexcept { return eta[a] != eta[b]; }
};

struct ConductorTerm {
  ChannelValues n;
  ChannelValues k;
  void operator()(double cos_d, ChannelValues& out) const noexcept {
    for (std::size_t c = 0; c < kModelChannels; ++c) {
      out[c] = formulas::conductor_fresnel(n[c], k[c], cos_d);
    }
  }
  void block(std::size_t c, const GeometryBlock& g, BlockArray& out) const noexcept {
    kernels::conductor_fresnel(n[c], k[c], g, out);
  }
  [[nodiscard]] bool differs(std::size_t a, std::size_t b) const noexcept {
    return n[a] != n[b] || k[a] != k[b];
  }
};

/// Calls make(term) with the inlined form of a run-time choice.
template <typename Make>
[[nodiscard]] std::shared_ptr<const Lobe> with_fresnel_term(const FacetFresnel& fresnel, const Make& make) {
  switch (fresnel.kind) {
    case FacetFresnel::Kind::kSchlick:
      return make(SchlickTerm{fresnel.a});
    case FacetFresnel::Kind::kDielectric:
      return make(DielectricTerm{fresnel.a});
    case FacetFresnel::Kind::kConductor:
      break;
  }
  return make(ConductorTerm{fresnel.a, fresnel.b});
}

}  // namespace scatter::reflectance
