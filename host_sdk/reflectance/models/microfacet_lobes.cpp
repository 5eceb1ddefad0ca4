#include "host_sdk/reflectance/models/block_kernels.h"
#include "host_sdk/reflectance/models/facet_fresnel.h"
#include "host_sdk/reflectance/models/formulas/cook_torrance.h"
#include "host_sdk/reflectance/models/formulas/microfacet.h"
#include "host_sdk/reflectance/models/lobes.h"
#include "host_sdk/reflectance/models/warp.h"

namespace scatter::reflectance {
namespace {

/// Isotropic GGX: one alpha per channel.
struct GgxFacets {
  ChannelValues alpha;

  [[nodiscard]] bool same() const noexcept { return alpha == uniform(alpha[0]); }
  [[nodiscard]] double lobe(std::size_t c, const formulas::Geometry& g) const noexcept {
    return formulas::ggx_lobe(alpha[c], g);
  }
  void block(std::size_t c, const GeometryBlock& g, BlockArray& out) const noexcept {
    kernels::ggx_lobe({alpha[c], alpha[c], alpha[c], alpha[c]}, g, out);
  }
  [[nodiscard]] Direction facet(std::size_t c, const Direction& omega_i, double u1,
                                double u2) const noexcept {
    return warp::visible_ggx_facet(alpha[c], alpha[c], omega_i, u1, u2);
  }
  [[nodiscard]] double pdf(std::size_t c, const Direction& omega_i, const Direction& omega_o) const noexcept {
    return warp::visible_ggx_reflection_pdf(alpha[c], alpha[c], omega_i, omega_o);
  }
};

struct AnisotropicGgxFacets {
  ChannelValues x;
  ChannelValues y;

  [[nodiscard]] bool same() const noexcept { return x == uniform(x[0]) && y == uniform(y[0]); }
  [[nodiscard]] double lobe(std::size_t c, const formulas::Geometry& g) const noexcept {
    return formulas::ggx_lobe(x[c], y[c], g);
  }
  void block(std::size_t c, const GeometryBlock& g, BlockArray& out) const noexcept {
    kernels::ggx_lobe({x[c], y[c], x[c], y[c]}, g, out);
  }
  [[nodiscard]] Direction facet(std::size_t c, const Direction& omega_i, double u1,
                                double u2) const noexcept {
    return warp::visible_ggx_facet(x[c], y[c], omega_i, u1, u2);
  }
  [[nodiscard]] double pdf(std::size_t c, const Direction& omega_i, const Direction& omega_o) const noexcept {
    return warp::visible_ggx_reflection_pdf(x[c], y[c], omega_i, omega_o);
  }
};

/// Draws from all normals of a Beckmann surface.
struct GaussianFacets {
  ChannelValues alpha;

  [[nodiscard]] bool same() const noexcept { return alpha == uniform(alpha[0]); }
  [[nodiscard]] Direction facet(std::size_t c, const Direction& omega_i, double u1,
                                double u2) const noexcept {
    (void)omega_i;
    return warp::gaussian_facet(alpha[c], alpha[c], u1, u2);
  }
  [[nodiscard]] double pdf(std::size_t c, const Direction& omega_i, const Direction& omega_o) const noexcept {
    return warp::gaussian_facet_pdf(alpha[c], alpha[c], omega_i, omega_o);
  }
};

struct BeckmannFacets : GaussianFacets {
  [[nodiscard]] double lobe(std::size_t c, const formulas::Geometry& g) const noexcept {
    return formulas::beckmann_lobe(alpha[c], g);
  }
  void block(std::size_t c, const GeometryBlock& g, BlockArray& out) const noexcept {
    kernels::beckmann_distribution(alpha[c], g, out);
    const double masking_i = formulas::beckmann_masking_over_cos(alpha[c], g.i.z) / 4;
    for (std::size_t k = 0; k < kBlockSize; ++k) {
      out[k] *= masking_i * formulas::beckmann_masking_over_cos(alpha[c], g.o_z[k]);
    }
  }
};

struct CookTorranceFacets : GaussianFacets {
  ChannelValues k{};
  [[nodiscard]] bool same() const noexcept { return GaussianFacets::same() && k == uniform(k[0]); }
  [[nodiscard]] double lobe(std::size_t c, const formulas::Geometry& g) const noexcept {
    return k[c] * formulas::cook_torrance_lobe(alpha[c], g);
  }
  void block(std::size_t c, const GeometryBlock& g, BlockArray& out) const noexcept {
    kernels::cook_torrance_lobe(alpha[c], g, out);
    for (double& value : out) {
      value *= k[c];
    }
  }
};

template <typename Facets, typename Fresnel>
class FacetLobe final : public FormulaLobe<FacetLobe<Facets, Fresnel>> {
 public:
  FacetLobe(const Facets& facets, const Fresnel& fresnel) noexcept
      : facets_(facets), fresnel_(fresnel), same_(facets.same()) {}

  void value(const formulas::Geometry& g, ChannelValues& out) const noexcept {
    fresnel_(g.cos_d, out);
    double lobe = facets_.lobe(0, g);
    for (std::size_t c = 0; c < kModelChannels; ++c) {
      if (!same_ && c > 0) {
        lobe = facets_.lobe(c, g);
      }
      out[c] *= lobe;
    }
  }
  void add_block(const GeometryBlock& block, const ChannelValues& weight,
                 BlockValues& sum) const noexcept override {
    alignas(64) BlockArray lobe;
    alignas(64) BlockArray fresnel;
    for (std::size_t c = 0; c < kModelChannels; ++c) {
      if (c == 0 || !same_) {
        facets_.block(c, block, lobe);
      }
      if (c == 0 || fresnel_.differs(c, c - 1)) {
        fresnel_.block(c, block, fresnel);
      }
      kernels::add_product(weight[c], lobe, fresnel, sum.f_per_sr[c]);
    }
  }
  [[nodiscard]] ChannelValues strength(const Direction& omega_i) const noexcept override {
    ChannelValues out;
    fresnel_(omega_i.z, out);
    for (std::size_t c = 0; c < kModelChannels; ++c) {
      // Never 0: with F0 = 0 the facets that are seen at grazing angles still reflect.
      out[c] = 0.01 + 0.99 * out[c];
      if constexpr (requires { facets_.k; }) {
        out[c] *= 4 * facets_.k[c];
      }
    }
    return out;
  }
  [[nodiscard]] Direction sample(const Direction& omega_i, double u1, double u2,
                                 double u3) const noexcept override {
    return warp::reflect(omega_i, facets_.facet(same_ ? 0 : warp::pick_channel(u3), omega_i, u1, u2));
  }
  [[nodiscard]] double pdf(const Direction& omega_i, const Direction& omega_o) const noexcept override {
    return warp::channel_mean(same_, [&](std::size_t c) { return facets_.pdf(c, omega_i, omega_o); });
  }

 private:
  Facets facets_;
  Fresnel fresnel_;
  bool same_;
};

template <typename Facets>
std::shared_ptr<const Lobe> make_facet_lobe(const FacetFresnel& fresnel, const Facets& facets) {
  return with_fresnel_term(fresnel, [&](const auto& term) -> std::shared_ptr<const Lobe> {
    return std::make_shared<FacetLobe<Facets, std::decay_t<decltype(term)>>>(facets, term);
  });
}

}  // namespace

std::shared_ptr<const Lobe> make_ggx_lobe(const FacetFresnel& fresnel, const ChannelValues& alpha_x,
                                          const ChannelValues& alpha_y) {
  if (alpha_x == alpha_y) {
    return make_facet_lobe(fresnel, GgxFacets{alpha_x});
  }
  return make_facet_lobe(fresnel, AnisotropicGgxFacets{alpha_x, alpha_y});
}

std::shared_ptr<const Lobe> make_beckmann_lobe(const FacetFresnel& fresnel, const ChannelValues& alpha) {
  return make_facet_lobe(fresnel, BeckmannFacets{{alpha}});
}

std::shared_ptr<const Lobe> make_cook_torrance_lobe(const FacetFresnel& fresnel, const ChannelValues& k,
                                                    const ChannelValues& m) {
  return make_facet_lobe(fresnel, CookTorranceFacets{{m}, k});
}

}  // namespace scatter::reflectance
