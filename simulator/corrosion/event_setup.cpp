#include "simulator/corrosion/event_setup.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "simulator/corrosion/map.h"

namespace scatter::corrosion {
namespace {

/// 0 stays 0, anything above is at least 1, the largest is 65535; empty when all cells of metal are alike.
std::vector<std::uint16_t> weights_of(const std::vector<float>& values,
                                      const std::vector<std::uint8_t>& opening) {
  float largest = 0;
  float smallest = INFINITY;
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (opening.empty() || opening[i] == 0) {
      largest = std::max(largest, values[i]);
      smallest = std::min(smallest, values[i]);
    }
  }
  if (smallest >= largest) {
    return {};
  }
  std::vector<std::uint16_t> result(values.size());
  for (std::size_t i = 0; i < values.size(); ++i) {
    const float share = std::round(values[i] / largest * 65535.0F);
    result[i] =
        values[i] > 0 ? static_cast<std::uint16_t>(std::clamp(share, 1.0F, 65535.0F)) : std::uint16_t{0};
  }
  return result;
}

/// Rounded up to whole units: n hits of an n-th of the thickness leave nothing, not a unit for one more hit.
float whole_bite(double bite, float structure) {
  const double units = std::ceil(bite * 2 * static_cast<double>(structure) * kUnitsPerThickness - 1e-6);
  return static_cast<float>(std::clamp(units, 0.0, kUnitsPerThickness) / kUnitsPerThickness);
}

bool constant(const Map& map) {
  return map.values.size() == 1;
}

}  // namespace

EventSetup event_setup(const GrowthOptions& options, std::vector<std::uint8_t> opening,
                       const std::vector<float>& susceptibility) {
  EventSetup setup;
  setup.border = options.border;
  setup.conversion_removes = options.events.conversion_removes;
  setup.side = static_cast<std::uint32_t>(options.side);
  setup.opening = std::move(opening);
  setup.metal_cells = options.side * options.side -
                      static_cast<std::size_t>(std::count(setup.opening.begin(), setup.opening.end(), 1));
  if (susceptibility.size() > 1) {
    setup.width_weight = weights_of(susceptibility, setup.opening);
  }
  if (constant(options.material) && constant(options.exposure)) {
    const float structure = 1 - options.material.values[0];
    setup.bite = {whole_bite(options.events.bite, structure)};
    setup.deepens = structure * options.exposure.values[0] > 0;
  } else {
    std::vector<float> structure = on_grid(options.material, options.side);
    setup.bite.resize(structure.size());
    for (std::size_t i = 0; i < structure.size(); ++i) {
      structure[i] = 1 - structure[i];
      setup.bite[i] = whole_bite(options.events.bite, structure[i]);
    }
    const std::vector<float> exposure = on_grid(options.exposure, options.side);
    for (std::size_t i = 0; i < structure.size(); ++i) {
      structure[i] *= exposure[i];
      setup.deepens = setup.deepens || structure[i] > 0;
    }
    setup.depth_weight = weights_of(structure, setup.opening);
  }
  setup.largest_bite = *std::max_element(setup.bite.begin(), setup.bite.end());
  return setup;
}

double units_of_loss(const GrowthOptions& options, const EventSetup& setup, double g_per_m2) noexcept {
  return g_per_m2 / metal_g_per_m2(options) * static_cast<double>(setup.metal_cells) * kUnitsPerThickness;
}

std::int64_t target_units(const GrowthOptions& options, const EventSetup& setup, double years) noexcept {
  return std::llround(units_of_loss(options, setup, attainable_loss_g_per_m2(options, years)));
}

double loss_of_units(const GrowthOptions& options, const EventSetup& setup, double units) noexcept {
  return units / kUnitsPerThickness / static_cast<double>(std::max<std::size_t>(setup.metal_cells, 1)) *
         metal_g_per_m2(options);
}

}  // namespace scatter::corrosion
