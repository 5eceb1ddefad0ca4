#include "host_sdk/reflectance/estimators/extent.h"

#include <algorithm>
#include <cmath>

#include "host_sdk/reflectance/estimators/estimator.h"
#include "host_sdk/reflectance/estimators/scattered_brdf.h"
#include "host_sdk/reflectance/grid_brdf.h"
#include "host_sdk/reflectance/specular_grid_brdf.h"

namespace scatter::reflectance {
namespace {

void sort_unique(std::vector<double>& angles) {
  std::ranges::sort(angles);
  const auto same = [](double a, double b) { return b - a <= kSameAngle; };
  angles.erase(std::unique(angles.begin(), angles.end(), same), angles.end());
}

Extent of_grid(const GridBrdf& grid) {
  const GridBrdf::Content& content = grid.content();
  Extent extent;
  std::size_t last_row = 0;
  bool one_rotation = true;
  for (const GridPart& part : content.parts) {
    extent.theta_i.push_back(part.theta_i);
    // The azimuth of light along the normal says nothing; the steepest incidence is the last one.
    extent.azimuth = part.phi_i;
    one_rotation =
        one_rotation && std::abs(part.rotation_rad - content.parts.front().rotation_rad) <= kSameAngle;
    for (std::size_t n = part.origin.size(); n > (last_row + 1) * content.phi_count; --n) {
      if (part.origin[n - 1] == Origin::kMeasured || part.origin[n - 1] == Origin::kInterpolated) {
        last_row = (n - 1) / content.phi_count;
        break;
      }
    }
  }
  if (!one_rotation) {
    extent.azimuth.reset();
  }
  extent.theta_o_to = std::min(kPi / 2, static_cast<double>(last_row) * content.theta_step);
  return extent;
}

/// Fewer sites per incidence than this on average: the samples lie in no order, incidences say nothing.
constexpr std::size_t kFewestPerIncidence = 8;

Extent of_samples(const ScatteredBrdf& samples) {
  Extent extent;
  extent.azimuth = samples.azimuth();
  extent.theta_o_to = 0;
  for (const ScatteredBrdf::Site& site : samples.sites()) {
    if (site.held > 0) {
      extent.theta_i.push_back(theta_of(site.omega_i));
      extent.theta_o_to = std::max(extent.theta_o_to, exit_theta(samples.type(), site.omega_o));
    }
  }
  sort_unique(extent.theta_i);
  if (extent.theta_i.size() * kFewestPerIncidence > samples.site_count()) {
    extent.theta_i.clear();
  }
  return extent;
}

}  // namespace

Extent extent_of(const Brdf& brdf) {
  Extent extent;
  if (const auto* link = dynamic_cast<const Estimator*>(&brdf)) {
    return extent_of(link->inner());
  }
  if (const auto* grid = dynamic_cast<const GridBrdf*>(&brdf)) {
    extent = of_grid(*grid);
  } else if (const auto* samples = dynamic_cast<const ScatteredBrdf*>(&brdf)) {
    extent = of_samples(*samples);
  } else if (const auto* specular = dynamic_cast<const SpecularGridBrdf*>(&brdf)) {
    extent.theta_i = specular->content().theta_i;
    if (specular->content().rotation.size() == 1) {
      extent.azimuth = specular->content().rotation.front();
    }
  }
  sort_unique(extent.theta_i);
  return extent;
}

}  // namespace scatter::reflectance
