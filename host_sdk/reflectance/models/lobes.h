// Every lobe that models are summed from. Formulas and their sources: formulas/.
#pragma once

#include <cstdint>
#include <memory>

#include "host_sdk/reflectance/models/formulas/ward.h"
#include "host_sdk/reflectance/models/lobe.h"
#include "host_sdk/reflectance/models/model_channels.h"

// Parameters are per channel; their ranges are checked by make_model, not here. Roughnesses > 0.
namespace scatter::reflectance {

/// albedo / pi.
[[nodiscard]] std::shared_ptr<const Lobe> make_lambert_lobe(const ChannelValues& albedo);

/// Oren-Nayar: facets of this albedo whose slope angles have standard deviation sigma [rad].
[[nodiscard]] std::shared_ptr<const Lobe> make_oren_nayar_lobe(const ChannelValues& albedo,
                                                               const ChannelValues& sigma);

/// k (n + 2) / (2 pi) cos^n to the mirror direction (Lafortune and Willems 1994).
[[nodiscard]] std::shared_ptr<const Lobe> make_lafortune_lobe(const ChannelValues& k, const ChannelValues& n);

/// k cos^n to the mirror direction / cos_i (Phong 1975); k [1/sr].
[[nodiscard]] std::shared_ptr<const Lobe> make_phong_lobe(const ChannelValues& k, const ChannelValues& n);

/// k times Ward's lobe, isotropic when the alphas are equal.
[[nodiscard]] std::shared_ptr<const Lobe> make_ward_lobe(formulas::WardKind kind, const ChannelValues& k,
                                                         const ChannelValues& alpha_x,
                                                         const ChannelValues& alpha_y);

/// What a facet reflects.
struct FacetFresnel {
  enum class Kind : std::uint8_t {
    kSchlick,     ///< a = f0.
    kDielectric,  ///< a = n behind / n before the surface.
    kConductor,   ///< a + ib = n + ik, seen from index 1.
  };
  Kind kind = Kind::kSchlick;
  ChannelValues a{};
  ChannelValues b{};

  [[nodiscard]] static FacetFresnel schlick(const ChannelValues& f0) { return {Kind::kSchlick, f0, {}}; }
  [[nodiscard]] static FacetFresnel dielectric(const ChannelValues& eta) {
    return {Kind::kDielectric, eta, {}};
  }
  [[nodiscard]] static FacetFresnel conductor(const ChannelValues& n, const ChannelValues& k) {
    return {Kind::kConductor, n, k};
  }
};

/// F D G1 G1 / (4 cos_i cos_o) with GGX; drawn by visible normals.
[[nodiscard]] std::shared_ptr<const Lobe> make_ggx_lobe(const FacetFresnel& fresnel,
                                                        const ChannelValues& alpha_x,
                                                        const ChannelValues& alpha_y);

/// The same with Beckmann, isotropic; drawn by all normals.
[[nodiscard]] std::shared_ptr<const Lobe> make_beckmann_lobe(const FacetFresnel& fresnel,
                                                             const ChannelValues& alpha);

/// k F G D / (pi cos_i cos_o), Cook and Torrance 1982: k = 1/4 is the conserving one.
[[nodiscard]] std::shared_ptr<const Lobe> make_cook_torrance_lobe(const FacetFresnel& fresnel,
                                                                  const ChannelValues& k,
                                                                  const ChannelValues& m);

}  // namespace scatter::reflectance
