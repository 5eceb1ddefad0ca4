#include "host_sdk/reflectance/models/ggx.h"

#include <utility>
#include <vector>

#include "host_sdk/reflectance/models/formulas/fresnel.h"
#include "host_sdk/reflectance/models/formulas/microfacet.h"
#include "host_sdk/reflectance/models/lobes.h"

namespace scatter::reflectance {
namespace {

std::vector<WeightedLobe> lobes_of(const Ggx::Parameters& p) {
  std::vector<WeightedLobe> lobes{
      {make_ggx_lobe(FacetFresnel::schlick(p.f0), p.alpha, p.alpha_y.value_or(p.alpha))}};
  if (p.albedo != ChannelValues{}) {
    lobes.push_back({make_lambert_lobe(p.albedo)});
  }
  return lobes;
}

}  // namespace

Ggx::Ggx(const Parameters& parameters) : LobeModel(lobes_of(parameters)), parameters_(parameters) {}

Origin Ggx::eval(const Direction& omega_i, const Direction& omega_o,
                 std::span<double> f_per_sr) const noexcept {
  if (parameters_.alpha_y || !(omega_i.z > 0 && omega_o.z > 0)) {
    return LobeModel::eval(omega_i, omega_o, f_per_sr);
  }
  const formulas::Geometry g = formulas::make_geometry(omega_i, omega_o);
  const double weight = formulas::schlick_weight(g.cos_d);
  double lobe = 0;
  for (std::size_t c = 0; c < kModelChannels; ++c) {
    if (c == 0 || parameters_.alpha[c] != parameters_.alpha[c - 1]) {
      lobe = formulas::ggx_lobe(parameters_.alpha[c], g);
    }
    f_per_sr[c] =
        (parameters_.f0[c] + (1.0 - parameters_.f0[c]) * weight) * lobe + parameters_.albedo[c] / kPi;
  }
  return Origin::kMeasured;
}

}  // namespace scatter::reflectance
