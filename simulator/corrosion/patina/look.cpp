#include "simulator/corrosion/patina/look.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <span>

#include "simulator/corrosion/patina/kubelka_munk.h"

namespace scatter::corrosion {
namespace {

/// Below this the layers keep so little that nothing is left to share out.
constexpr double kBareLayerShare = 1e-6;

/// One cell: what the layers do to light, and who shows.
struct CellLook {
  std::array<double, 3> reflectance{};  ///< Layers over metal.
  double metalness = 1;
  double bare = 1;
  std::array<double, 3> shown{};  ///< By PatinaMaterial.
};

CellLook look_at(std::span<const PatinaLayer> layers, std::size_t cell, const Rgb& metal) {
  CellLook look;
  double twice = 0;
  std::array<double, 3> passing{1, 1, 1};
  for (std::size_t c = 0; c < 3; ++c) {
    LayerOptics below{metal[c], 0};
    double through = 1;
    for (const PatinaLayer& layer : layers) {
      const double thickness = layer.thickness_um[cell];
      if (thickness > 0) {
        const PatinaMaterialData& data = data_of(layer.material);
        const LayerOptics optics =
            layer_optics(data.absorption_per_um[c], data.scattering_per_um[c], thickness);
        below = over(optics, below);
        through *= optics.transmittance;
      }
    }
    look.reflectance[c] = below.reflectance;
    twice += through * through / 3;
  }
  look.metalness = twice;
  for (std::size_t k = layers.size(); k-- > 0;) {
    const double thickness = layers[k].thickness_um[cell];
    if (thickness <= 0) {
      continue;
    }
    const PatinaMaterialData& data = data_of(layers[k].material);
    double kept = 0;
    for (std::size_t c = 0; c < 3; ++c) {
      const double next =
          passing[c] *
          layer_optics(data.absorption_per_um[c], data.scattering_per_um[c], thickness).transmittance;
      kept += (passing[c] - next) / 3;
      passing[c] = next;
    }
    look.shown[static_cast<std::size_t>(layers[k].material)] += kept;
  }
  look.bare = (passing[0] + passing[1] + passing[2]) / 3;
  return look;
}

void set_normals(const LayerStack& stack, Appearance& appearance) {
  const std::vector<float> z = stack.surface_um();
  const std::size_t n = stack.side();
  const auto per_two_cells = static_cast<float>(1 / (2 * stack.cell_um()));
  for (std::size_t y = 0; y < n; ++y) {
    const float* above = z.data() + (y == 0 ? n - 1 : y - 1) * n;
    const float* row = z.data() + y * n;
    const float* below = z.data() + (y + 1 == n ? 0 : y + 1) * n;
    for (std::size_t x = 0; x < n; ++x) {
      const float slope_x = (row[x + 1 == n ? 0 : x + 1] - row[x == 0 ? n - 1 : x - 1]) * per_two_cells;
      const float slope_y = (above[x] - below[x]) * per_two_cells;
      const float to_unit = 1 / std::sqrt(1 + slope_x * slope_x + slope_y * slope_y);
      appearance.normal[y * n + x] = {-slope_x * to_unit, -slope_y * to_unit, to_unit};
    }
  }
}

}  // namespace

Appearance appearance(const LayerStack& stack, const PatinaLookOptions& options) {
  const std::size_t cells = stack.cells();
  Appearance maps{.side = stack.side(),
                  .albedo = std::vector<Rgb>(cells),
                  .regime = std::vector<Regime>(cells, Regime::kMetal),
                  .metalness = std::vector<float>(cells),
                  .roughness = std::vector<float>(cells),
                  .porosity = std::vector<float>(cells),
                  .opacity = std::vector<float>(cells, 1.0F),
                  .normal = std::vector<std::array<float, 3>>(cells)};
  for (std::size_t i = 0; i < cells; ++i) {
    const CellLook look = look_at(stack.layers(), i, options.metal);
    const double layer_share = 1 - look.metalness;
    for (std::size_t c = 0; c < 3; ++c) {
      const double metal = options.metal[c];
      const double albedo = layer_share > kBareLayerShare
                                ? (look.reflectance[c] - look.metalness * metal) / layer_share
                                : metal;
      maps.albedo[i][c] = static_cast<float>(std::clamp(albedo, 0.0, 1.0));
    }
    maps.metalness[i] = static_cast<float>(look.metalness);
    maps.regime[i] = layer_share > kBareLayerShare ? Regime::kRust : Regime::kMetal;
    double roughness = look.bare * options.metal_roughness;
    double porosity = 0;
    for (const PatinaMaterial material : kPatinaMaterials) {
      const double share = look.shown[static_cast<std::size_t>(material)];
      roughness += share * data_of(material).roughness;
      porosity += share * data_of(material).porosity;
    }
    maps.roughness[i] = static_cast<float>(roughness);
    maps.porosity[i] = static_cast<float>(porosity);
  }
  set_normals(stack, maps);
  return maps;
}

std::vector<Rgb> reflectance(const LayerStack& stack, const PatinaLookOptions& options) {
  std::vector<Rgb> colours(stack.cells());
  for (std::size_t i = 0; i < colours.size(); ++i) {
    const CellLook look = look_at(stack.layers(), i, options.metal);
    for (std::size_t c = 0; c < 3; ++c) {
      colours[i][c] = static_cast<float>(look.reflectance[c]);
    }
  }
  return colours;
}

Coverage coverage(const LayerStack& stack) {
  Coverage sum{0, 0, 0};
  for (std::size_t i = 0; i < stack.cells(); ++i) {
    const CellLook look = look_at(stack.layers(), i, kCopperReflectance);
    sum.bare += look.bare;
    sum.tarnish += look.shown[static_cast<std::size_t>(PatinaMaterial::kTarnish)];
    sum.patina += look.shown[static_cast<std::size_t>(PatinaMaterial::kSulphate)] +
                  look.shown[static_cast<std::size_t>(PatinaMaterial::kChloride)];
  }
  const auto cells = static_cast<double>(stack.cells());
  return {sum.bare / cells, sum.tarnish / cells, sum.patina / cells};
}

}  // namespace scatter::corrosion
