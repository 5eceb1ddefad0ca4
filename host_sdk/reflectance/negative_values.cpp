#include "host_sdk/reflectance/negative_values.h"

#include <algorithm>

#include "host_sdk/reflectance/adaptive_brdf.h"
#include "host_sdk/reflectance/grid_brdf.h"
#include "host_sdk/reflectance/specular_grid_brdf.h"

namespace scatter::reflectance {
namespace {

void look_at(double f, NegativeValues& out) {
  ++out.of;
  out.count += f < 0 ? 1 : 0;
  out.least = std::min(out.least, f);
}

NegativeValues of_grid(const GridBrdf& grid) {
  NegativeValues out;
  for (const GridPart& part : grid.content().parts) {
    for (const auto& plane : part.f_per_sr) {
      for (std::size_t n = 0; n < plane.size(); ++n) {
        if (part.origin[n] != Origin::kInvalid) {
          look_at(static_cast<double>(plane[n]), out);
        }
      }
    }
  }
  return out;
}

NegativeValues of_specular_grid(const SpecularGridBrdf& grid) {
  NegativeValues out;
  const auto& origin = grid.content().origin;
  for (const auto& plane : grid.content().f_per_sr) {
    for (std::size_t n = 0; n < plane.size(); ++n) {
      if (origin.empty() || origin[n] != Origin::kInvalid) {
        look_at(static_cast<double>(plane[n]), out);
      }
    }
  }
  return out;
}

NegativeValues of_adaptive(const AdaptiveBrdf& brdf) {
  NegativeValues out{.count_as_0 = true};
  const auto& content = brdf.content();
  const auto& values = content.spectra.values;
  const std::size_t nodes = content.spectra.width * content.spectra.height;
  // Tables lie as [incidence][channel][node], their validity as [incidence][node].
  for (std::size_t k = 0; k < values.size(); ++k) {
    const std::size_t node = k / (nodes * content.channels) * nodes + k % nodes;
    if (content.valid.empty() || content.valid[node] != 0) {
      look_at(static_cast<double>(values[k]), out);
    }
  }
  return out;
}

}  // namespace

NegativeValues negative_values(const Brdf& brdf) {
  if (const auto* grid = dynamic_cast<const GridBrdf*>(&brdf)) {
    return of_grid(*grid);
  }
  if (const auto* grid = dynamic_cast<const SpecularGridBrdf*>(&brdf)) {
    return of_specular_grid(*grid);
  }
  if (const auto* adaptive = dynamic_cast<const AdaptiveBrdf*>(&brdf)) {
    return of_adaptive(*adaptive);
  }
  return {};
}

NegativeValues negative_values(const ScatteredSamples& samples) {
  NegativeValues out;
  for (std::size_t k = 0; k < samples.f_per_sr.size(); ++k) {
    if (samples.origin_of(k / samples.channels) != Origin::kInvalid) {
      look_at(static_cast<double>(samples.f_per_sr[k]), out);
    }
  }
  return out;
}

}  // namespace scatter::reflectance
