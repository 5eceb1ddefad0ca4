#include "host_sdk/formats/exr_tile_layout.h"

#include <algorithm>
#include <cmath>

#include "host_sdk/reflectance/grid_brdf.h"

namespace scatter::formats {
namespace {

void sort_and_unite(std::vector<double>& values) {
  std::ranges::sort(values);
  const auto repeated = std::ranges::unique(values);
  values.erase(repeated.begin(), repeated.end());
}

}  // namespace

OwnIncidences own_incidences(const reflectance::Brdf& brdf) {
  OwnIncidences own;
  if (const auto* grid = dynamic_cast<const reflectance::GridBrdf*>(&brdf)) {
    // A rotation's azimuth is best defined by its steepest incidence; parts are sorted by rotation,
    // then theta_i.
    const auto& parts = grid->content().parts;
    for (std::size_t p = 0; p < parts.size(); ++p) {
      own.theta_i.push_back(parts[p].theta_i);
      if (p + 1 == parts.size() || parts[p + 1].rotation_rad != parts[p].rotation_rad) {
        const double turns = parts[p].phi_i / (2 * reflectance::kPi);
        own.rotation.push_back(2 * reflectance::kPi * (turns - std::floor(turns)));
      }
    }
  } else if (const auto* specular = dynamic_cast<const reflectance::SpecularGridBrdf*>(&brdf)) {
    own.theta_i = specular->content().theta_i;
    own.rotation = specular->content().rotation;
  }
  sort_and_unite(own.theta_i);
  sort_and_unite(own.rotation);
  return own;
}

std::size_t near_square_columns(std::size_t tiles, std::size_t width, std::size_t height) {
  const double columns = std::ceil(
      std::sqrt(static_cast<double>(tiles) * static_cast<double>(height) / static_cast<double>(width)));
  return std::clamp<std::size_t>(static_cast<std::size_t>(columns), 1, std::max<std::size_t>(1, tiles));
}

}  // namespace scatter::formats
