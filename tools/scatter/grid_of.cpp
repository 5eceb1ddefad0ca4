#include "tools/scatter/grid_of.h"

#include <algorithm>
#include <cmath>

#include "host_sdk/reflectance/sampled_grid.h"

namespace scatter::cli {

using reflectance::GridBrdf;

Result<std::shared_ptr<const GridBrdf>> grid_of(const reflectance::Brdf& brdf,
                                                const std::vector<plot::Incidence>& incidences) {
  if (const auto* grid = dynamic_cast<const GridBrdf*>(&brdf)) {
    const auto own = plot::incidences_of(brdf);
    const bool same = std::ranges::equal(own, incidences, [](const auto& a, const auto& b) {
      return std::abs(a.theta_i - b.theta_i) < 1e-9 && std::abs(a.phi_i - b.phi_i) < 1e-9;
    });
    if (same) {
      return std::make_shared<const GridBrdf>(*grid);
    }
  }
  reflectance::GridLayout layout;
  layout.incidences.clear();
  for (const auto& light : incidences) {
    layout.incidences.push_back({.rotation_rad = 0, .theta_i = light.theta_i, .phi_i = light.phi_i});
  }
  auto sampled = reflectance::sample_on_grid(brdf, layout);
  if (!sampled) {
    return std::unexpected(sampled.error());
  }
  return std::make_shared<const GridBrdf>(std::move(*sampled));
}

}  // namespace scatter::cli
