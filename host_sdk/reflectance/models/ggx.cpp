#include "host_sdk/reflectance/models/ggx.h"

#include <utility>
#include <vector>

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

}  // namespace scatter::reflectance
