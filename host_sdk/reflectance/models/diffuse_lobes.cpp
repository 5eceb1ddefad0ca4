#include "host_sdk/reflectance/models/block_kernels.h"
#include "host_sdk/reflectance/models/cosine_lobe.h"
#include "host_sdk/reflectance/models/formulas/oren_nayar.h"
#include "host_sdk/reflectance/models/lobes.h"

namespace scatter::reflectance {
namespace {

class LambertLobe final : public FormulaLobe<LambertLobe, CosineLobe> {
 public:
  explicit LambertLobe(const ChannelValues& albedo) noexcept : albedo_(albedo) {
    for (std::size_t c = 0; c < kModelChannels; ++c) {
      f_per_sr_[c] = albedo[c] / kPi;
    }
  }
  void value(const formulas::Geometry& g, ChannelValues& out) const noexcept {
    (void)g;
    out = f_per_sr_;
  }
  void add_block(const GeometryBlock& block, const ChannelValues& weight,
                 BlockValues& sum) const noexcept override {
    (void)block;
    for (std::size_t c = 0; c < kModelChannels; ++c) {
      for (double& f : sum.f_per_sr[c]) {
        f += weight[c] * f_per_sr_[c];
      }
    }
  }
  [[nodiscard]] ChannelValues strength(const Direction& omega_i) const noexcept override {
    (void)omega_i;
    return albedo_;
  }

 private:
  ChannelValues albedo_;
  ChannelValues f_per_sr_{};
};

class OrenNayarLobe final : public FormulaLobe<OrenNayarLobe, CosineLobe> {
 public:
  OrenNayarLobe(const ChannelValues& albedo, const ChannelValues& sigma) noexcept
      : albedo_(albedo), sigma_(sigma) {}
  void value(const formulas::Geometry& g, ChannelValues& out) const noexcept {
    for (std::size_t c = 0; c < kModelChannels; ++c) {
      out[c] = albedo_[c] * formulas::oren_nayar(sigma_[c], g);
    }
  }
  void add_block(const GeometryBlock& block, const ChannelValues& weight,
                 BlockValues& sum) const noexcept override {
    alignas(64) BlockArray shape;
    for (std::size_t c = 0; c < kModelChannels; ++c) {
      if (c == 0 || sigma_[c] != sigma_[c - 1]) {
        kernels::oren_nayar(sigma_[c], block, shape);
      }
      kernels::add(weight[c] * albedo_[c], shape, sum.f_per_sr[c]);
    }
  }
  [[nodiscard]] ChannelValues strength(const Direction& omega_i) const noexcept override {
    (void)omega_i;
    return albedo_;
  }

 private:
  ChannelValues albedo_;
  ChannelValues sigma_;
};

}  // namespace

std::shared_ptr<const Lobe> make_lambert_lobe(const ChannelValues& albedo) {
  return std::make_shared<LambertLobe>(albedo);
}

std::shared_ptr<const Lobe> make_oren_nayar_lobe(const ChannelValues& albedo, const ChannelValues& sigma) {
  return std::make_shared<OrenNayarLobe>(albedo, sigma);
}

}  // namespace scatter::reflectance
