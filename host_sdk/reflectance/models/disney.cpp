#include "host_sdk/reflectance/models/disney.h"

#include <memory>
#include <utility>
#include <vector>

#include "host_sdk/reflectance/models/block_kernels.h"
#include "host_sdk/reflectance/models/cosine_lobe.h"
#include "host_sdk/reflectance/models/formulas/disney.h"
#include "host_sdk/reflectance/models/formulas/fresnel.h"
#include "host_sdk/reflectance/models/lobe.h"
#include "host_sdk/reflectance/models/warp.h"

namespace scatter::reflectance {
namespace {

double mix(double a, double b, double t) noexcept {
  return a + t * (b - a);
}

/// Base, subsurface and sheen; weighted by 1 - metallic outside.
class DisneyBaseLobe final : public FormulaLobe<DisneyBaseLobe, CosineLobe> {
 public:
  explicit DisneyBaseLobe(const Disney::Parameters& p) noexcept
      : color_(p.base_color), roughness_(p.roughness), subsurface_(p.subsurface) {
    const ChannelValues tint = disney_tint(p.base_color);
    for (std::size_t c = 0; c < kModelChannels; ++c) {
      sheen_[c] = p.sheen * mix(1, tint[c], p.sheen_tint);
    }
  }
  void value(const formulas::Geometry& g, ChannelValues& out) const noexcept {
    double base = formulas::disney_diffuse(roughness_, g);
    if (subsurface_ > 0) {
      base = mix(base, formulas::disney_subsurface(roughness_, g), subsurface_);
    }
    const double grazing = formulas::schlick_weight(g.cos_d);
    for (std::size_t c = 0; c < kModelChannels; ++c) {
      out[c] = color_[c] * base / kPi + sheen_[c] * grazing;
    }
  }
  void add_block(const GeometryBlock& block, const ChannelValues& weight,
                 BlockValues& sum) const noexcept override {
    alignas(64) BlockArray base;
    alignas(64) BlockArray grazing;
    kernels::disney_base(roughness_, subsurface_, block, base);
    kernels::schlick_fresnel(0, block, grazing);
    for (std::size_t c = 0; c < kModelChannels; ++c) {
      kernels::add(weight[c] * color_[c] / kPi, base, sum.f_per_sr[c]);
      kernels::add(weight[c] * sheen_[c], grazing, sum.f_per_sr[c]);
    }
  }
  [[nodiscard]] ChannelValues strength(const Direction& omega_i) const noexcept override {
    // Sheen's albedo grows from 0.03 at normal incidence to about 0.3 at grazing.
    const double grazing = 0.03 + 0.3 * formulas::schlick_weight(omega_i.z);
    ChannelValues out = color_;
    for (std::size_t c = 0; c < kModelChannels; ++c) {
      out[c] += sheen_[c] * grazing;
    }
    return out;
  }

 private:
  ChannelValues color_;
  ChannelValues sheen_{};
  double roughness_;
  double subsurface_;
};

class DisneySpecularLobe final : public FormulaLobe<DisneySpecularLobe> {
 public:
  explicit DisneySpecularLobe(const Disney::Parameters& p) noexcept
      : f0_(disney_f0(p)),
        roughness_(p.roughness),
        anisotropic_(p.anisotropic),
        alpha_(formulas::disney_alpha(p.roughness, p.anisotropic)) {}
  void value(const formulas::Geometry& g, ChannelValues& out) const noexcept {
    const double lobe = formulas::disney_specular_lobe(roughness_, anisotropic_, g);
    for (std::size_t c = 0; c < kModelChannels; ++c) {
      out[c] = formulas::schlick_fresnel(f0_[c], g.cos_d) * lobe;
    }
  }
  void add_block(const GeometryBlock& block, const ChannelValues& weight,
                 BlockValues& sum) const noexcept override {
    alignas(64) BlockArray lobe;
    alignas(64) BlockArray fresnel;
    const double shadowing = (0.5 + 0.5 * roughness_) * (0.5 + 0.5 * roughness_);
    kernels::ggx_lobe({alpha_.x, alpha_.y, shadowing, shadowing}, block, lobe);
    for (std::size_t c = 0; c < kModelChannels; ++c) {
      kernels::schlick_fresnel(f0_[c], block, fresnel);
      kernels::add_product(weight[c], lobe, fresnel, sum.f_per_sr[c]);
    }
  }
  [[nodiscard]] ChannelValues strength(const Direction& omega_i) const noexcept override {
    ChannelValues out{};
    for (std::size_t c = 0; c < kModelChannels; ++c) {
      // Never 0, even where F0 is: the lobe is still there at grazing half vectors.
      out[c] = formulas::schlick_fresnel(mix(0.01, 1, f0_[c]), omega_i.z);
    }
    return out;
  }
  [[nodiscard]] Direction sample(const Direction& omega_i, double u1, double u2,
                                 double u3) const noexcept override {
    (void)u3;
    return warp::reflect(omega_i, warp::visible_ggx_facet(alpha_.x, alpha_.y, omega_i, u1, u2));
  }
  [[nodiscard]] double pdf(const Direction& omega_i, const Direction& omega_o) const noexcept override {
    return warp::visible_ggx_reflection_pdf(alpha_.x, alpha_.y, omega_i, omega_o);
  }

 private:
  ChannelValues f0_;
  double roughness_;
  double anisotropic_;
  formulas::DisneyAlpha<double> alpha_;
};

/// At clearcoat = 1; weighted by clearcoat outside.
class DisneyClearcoatLobe final : public FormulaLobe<DisneyClearcoatLobe> {
 public:
  explicit DisneyClearcoatLobe(double gloss) noexcept
      : gloss_(gloss), alpha_(formulas::disney_clearcoat_alpha(gloss)) {}
  void value(const formulas::Geometry& g, ChannelValues& out) const noexcept {
    out = uniform(formulas::disney_clearcoat_lobe(gloss_, g));
  }
  void add_block(const GeometryBlock& block, const ChannelValues& weight,
                 BlockValues& sum) const noexcept override {
    alignas(64) BlockArray lobe;
    kernels::disney_clearcoat_lobe(gloss_, block, lobe);
    for (std::size_t c = 0; c < kModelChannels; ++c) {
      kernels::add(weight[c], lobe, sum.f_per_sr[c]);
    }
  }
  [[nodiscard]] ChannelValues strength(const Direction& omega_i) const noexcept override {
    return uniform(0.25 * formulas::schlick_fresnel(0.04, omega_i.z));
  }
  [[nodiscard]] Direction sample(const Direction& omega_i, double u1, double u2,
                                 double u3) const noexcept override {
    (void)u3;
    return warp::reflect(omega_i, warp::gtr1_facet(alpha_, u1, u2));
  }
  [[nodiscard]] double pdf(const Direction& omega_i, const Direction& omega_o) const noexcept override {
    const Direction h = warp::facet_normal(omega_i, omega_o);
    const double cos_d = std::abs(dot(omega_i, h));
    if (!(h.z > 0 && cos_d > 0)) {
      return 0;
    }
    return formulas::gtr1_distribution(alpha_, h.z, h.x * h.x + h.y * h.y) * h.z / (4 * cos_d);
  }

 private:
  double gloss_;
  double alpha_;
};

std::vector<WeightedLobe> lobes_of(const Disney::Parameters& p) {
  std::vector<WeightedLobe> lobes;
  if (p.metallic < 1) {
    lobes.push_back({std::make_shared<DisneyBaseLobe>(p), uniform(1 - p.metallic)});
  }
  lobes.push_back({std::make_shared<DisneySpecularLobe>(p)});
  if (p.clearcoat > 0) {
    lobes.push_back({std::make_shared<DisneyClearcoatLobe>(p.clearcoat_gloss), uniform(p.clearcoat)});
  }
  return lobes;
}

}  // namespace

ChannelValues disney_tint(const ChannelValues& base_color) noexcept {
  const double luminance = 0.3 * base_color[0] + 0.6 * base_color[1] + 0.1 * base_color[2];
  if (!(luminance > 0)) {
    return uniform(1);
  }
  ChannelValues tint = base_color;
  for (double& value : tint) {
    value /= luminance;
  }
  return tint;
}

ChannelValues disney_f0(const Disney::Parameters& parameters) noexcept {
  const ChannelValues tint = disney_tint(parameters.base_color);
  ChannelValues f0{};
  for (std::size_t c = 0; c < kModelChannels; ++c) {
    const double dielectric = 0.08 * parameters.specular * mix(1, tint[c], parameters.specular_tint);
    f0[c] = mix(dielectric, parameters.base_color[c], parameters.metallic);
  }
  return f0;
}

Disney::Disney(const Parameters& parameters) : LobeModel(lobes_of(parameters)), parameters_(parameters) {}

}  // namespace scatter::reflectance
