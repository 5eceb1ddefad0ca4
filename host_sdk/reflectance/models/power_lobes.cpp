#include "host_sdk/reflectance/models/block_kernels.h"
#include "host_sdk/reflectance/models/formulas/lafortune.h"
#include "host_sdk/reflectance/models/lobes.h"
#include "host_sdk/reflectance/models/warp.h"

namespace scatter::reflectance {
namespace {

enum class PowerKind : std::uint8_t { kPhong, kLafortune };

template <PowerKind kKind>
class PowerLobe final : public FormulaLobe<PowerLobe<kKind>> {
 public:
  PowerLobe(const ChannelValues& k, const ChannelValues& n) noexcept
      : k_(k), n_(n), same_(n == uniform(n[0])) {}

  void value(const formulas::Geometry& g, ChannelValues& out) const noexcept {
    double lobe = shape(0, g);
    for (std::size_t c = 0; c < kModelChannels; ++c) {
      if (!same_ && c > 0) {
        lobe = shape(c, g);
      }
      out[c] = k_[c] * lobe;
    }
  }
  void add_block(const GeometryBlock& block, const ChannelValues& weight,
                 BlockValues& sum) const noexcept override {
    alignas(64) BlockArray power;
    for (std::size_t c = 0; c < kModelChannels; ++c) {
      if (c == 0 || !same_) {
        kernels::mirror_power(n_[c], block, power);
      }
      const double height = kKind == PowerKind::kPhong ? 1 / block.i.z : (n_[c] + 2) / (2 * kPi);
      kernels::add(weight[c] * k_[c] * height, power, sum.f_per_sr[c]);
    }
  }
  [[nodiscard]] ChannelValues strength(const Direction& omega_i) const noexcept override {
    (void)omega_i;
    ChannelValues out = k_;
    if constexpr (kKind == PowerKind::kPhong) {
      for (std::size_t c = 0; c < kModelChannels; ++c) {
        out[c] *= 2 * kPi / (n_[c] + 1);  // The whole lobe, its cosines taken as 1.
      }
    }
    return out;
  }
  [[nodiscard]] Direction sample(const Direction& omega_i, double u1, double u2,
                                 double u3) const noexcept override {
    return warp::power_cosine(mirrored(omega_i), n_[same_ ? 0 : warp::pick_channel(u3)], u1, u2);
  }
  [[nodiscard]] double pdf(const Direction& omega_i, const Direction& omega_o) const noexcept override {
    const double cos_mirror = dot(mirrored(omega_i), omega_o);
    if (!(cos_mirror > 0)) {
      return 0;
    }
    return warp::channel_mean(
        same_, [&](std::size_t c) { return (n_[c] + 1) / (2 * kPi) * std::pow(cos_mirror, n_[c]); });
  }

 private:
  [[nodiscard]] double shape(std::size_t c, const formulas::Geometry& g) const noexcept {
    if constexpr (kKind == PowerKind::kPhong) {
      return formulas::phong_lobe(n_[c], g);
    } else {
      return formulas::lafortune_phong_lobe(n_[c], g);
    }
  }

  ChannelValues k_;
  ChannelValues n_;
  bool same_;
};

}  // namespace

std::shared_ptr<const Lobe> make_phong_lobe(const ChannelValues& k, const ChannelValues& n) {
  return std::make_shared<PowerLobe<PowerKind::kPhong>>(k, n);
}

std::shared_ptr<const Lobe> make_lafortune_lobe(const ChannelValues& k, const ChannelValues& n) {
  return std::make_shared<PowerLobe<PowerKind::kLafortune>>(k, n);
}

}  // namespace scatter::reflectance
