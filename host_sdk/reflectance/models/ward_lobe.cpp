#include "host_sdk/reflectance/models/formulas/ward.h"

#include "host_sdk/reflectance/models/block_kernels.h"
#include "host_sdk/reflectance/models/lobes.h"
#include "host_sdk/reflectance/models/warp.h"

namespace scatter::reflectance {
namespace {

class WardLobe final : public FormulaLobe<WardLobe> {
 public:
  WardLobe(formulas::WardKind kind, const ChannelValues& k, const ChannelValues& alpha_x,
           const ChannelValues& alpha_y) noexcept
      : kind_(kind),
        k_(k),
        x_(alpha_x),
        y_(alpha_y),
        same_(alpha_x == uniform(alpha_x[0]) && alpha_y == uniform(alpha_y[0])) {}

  void value(const formulas::Geometry& g, ChannelValues& out) const noexcept {
    double lobe = formulas::ward_lobe(kind_, x_[0], y_[0], g);
    for (std::size_t c = 0; c < kModelChannels; ++c) {
      if (!same_ && c > 0) {
        lobe = formulas::ward_lobe(kind_, x_[c], y_[c], g);
      }
      out[c] = k_[c] * lobe;
    }
  }
  void add_block(const GeometryBlock& block, const ChannelValues& weight,
                 BlockValues& sum) const noexcept override {
    alignas(64) BlockArray lobe;
    for (std::size_t c = 0; c < kModelChannels; ++c) {
      if (c == 0 || !same_) {
        kernels::ward_lobe(kind_, x_[c], y_[c], block, lobe);
      }
      kernels::add(weight[c] * k_[c], lobe, sum.f_per_sr[c]);
    }
  }
  [[nodiscard]] ChannelValues strength(const Direction& omega_i) const noexcept override {
    (void)omega_i;
    return k_;
  }
  [[nodiscard]] Direction sample(const Direction& omega_i, double u1, double u2,
                                 double u3) const noexcept override {
    const std::size_t c = same_ ? 0 : warp::pick_channel(u3);
    return warp::reflect(omega_i, warp::gaussian_facet(x_[c], y_[c], u1, u2));
  }
  [[nodiscard]] double pdf(const Direction& omega_i, const Direction& omega_o) const noexcept override {
    return warp::channel_mean(
        same_, [&](std::size_t c) { return warp::gaussian_facet_pdf(x_[c], y_[c], omega_i, omega_o); });
  }

 private:
  formulas::WardKind kind_;
  ChannelValues k_;
  ChannelValues x_;
  ChannelValues y_;
  bool same_;
};

}  // namespace

std::shared_ptr<const Lobe> make_ward_lobe(formulas::WardKind kind, const ChannelValues& k,
                                           const ChannelValues& alpha_x, const ChannelValues& alpha_y) {
  return std::make_shared<WardLobe>(kind, k, alpha_x, alpha_y);
}

}  // namespace scatter::reflectance
