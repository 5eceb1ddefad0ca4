#include "tools/plot/incidence.h"

#include <algorithm>
#include <cmath>

#include "host_sdk/reflectance/grid_brdf.h"
#include "host_sdk/reflectance/specular_grid_brdf.h"
#include "tools/plot/ticks.h"

namespace scatter::plot {

using reflectance::kPi;
using reflectance::radians;

std::vector<Incidence> incidences_of(const reflectance::Brdf& brdf) {
  std::vector<Incidence> result;
  if (const auto* grid = dynamic_cast<const reflectance::GridBrdf*>(&brdf)) {
    for (const auto& part : grid->content().parts) {
      result.push_back({part.theta_i, part.phi_i});
    }
    return result;
  }
  if (const auto* grid = dynamic_cast<const reflectance::SpecularGridBrdf*>(&brdf)) {
    for (const double rotation : grid->content().rotation) {
      for (const double theta_i : grid->content().theta_i) {
        result.push_back({theta_i, rotation});
      }
    }
    return result;
  }
  for (const double theta_deg : {0.0, 20.0, 40.0, 60.0}) {
    result.push_back({radians(theta_deg), 0});
  }
  return result;
}

std::vector<std::size_t> evenly_spaced(std::size_t count, std::size_t limit) {
  std::vector<std::size_t> places;
  const std::size_t kept = std::min(count, std::max<std::size_t>(1, limit));
  for (std::size_t k = 0; k < kept; ++k) {
    places.push_back(kept == 1 ? 0 : k * (count - 1) / (kept - 1));
  }
  return places;
}

bool turned(const std::vector<Incidence>& incidences) {
  return std::ranges::any_of(incidences, [&](const Incidence& light) {
    return std::abs(std::remainder(light.phi_i - incidences.front().phi_i, 2 * kPi)) > 1e-6;
  });
}

std::string incidence_name(const Incidence& incidence, bool turned) {
  const std::string name = "θᵢ = " + angle_text(incidence.theta_i);
  return turned ? name + ", φᵢ = " + angle_text(incidence.phi_i) : name;
}

}  // namespace scatter::plot
