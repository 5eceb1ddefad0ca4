// A corroded sheet made by hand, for tests that must not depend on how rust grows; and the sum over its cells
// that the fast scattering is judged by.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <vector>

#include "host_sdk/reflectance/albedo.h"
#include "host_sdk/reflectance/models/formulas/fresnel.h"
#include "host_sdk/reflectance/models/formulas/geometry.h"
#include "host_sdk/reflectance/models/formulas/microfacet.h"
#include "host_sdk/reflectance/models/formulas/oren_nayar.h"
#include "simulator/samples/textured_sheet.h"

namespace scatter::simulator::test {

using reflectance::Direction;
using reflectance::kPi;
using Values = std::array<double, 3>;

struct MadeOptions {
  std::size_t side = 256;
  double extent_mm = 15;
  double rust = 0.5;         ///< Threshold: the higher, the more rust, -1..2.
  double depth_mm = 0.2;     ///< Of the deepest pits.
  double hole_depth_mm = 9;  ///< Deeper than this is a hole.
};

/// Sum of waves of several lengths, toroidal, about -1..1.
inline double waves(double u, double v, double phase) {
  return 0.4 * std::sin(2 * kPi * (3 * u + 2 * v) + phase) +
         0.3 * std::sin(2 * kPi * (7 * u - 5 * v) + 2 * phase) +
         0.2 * std::sin(2 * kPi * (13 * v + 11 * u) + 3 * phase) +
         0.15 * std::sin(2 * kPi * (29 * u - 23 * v) + phase);
}

inline corrosion::Appearance made_maps(const MadeOptions& o) {
  const std::size_t n = o.side;
  corrosion::Appearance maps;
  maps.side = n;
  std::vector<double> depth(n * n, 0.0);
  const auto share = [&](std::size_t k) { return (static_cast<double>(k) + 0.5) / static_cast<double>(n); };
  for (std::size_t y = 0; y < n; ++y) {
    for (std::size_t x = 0; x < n; ++x) {
      const double over = waves(share(x), share(y), 0.3) + o.rust - 0.5;
      if (over > 0) {
        depth[y * n + x] = 0.005 + o.depth_mm * over * (0.6 + 0.4 * waves(share(x), share(y), 1.7));
      }
    }
  }
  const double cell_mm = o.extent_mm / static_cast<double>(n);
  for (std::size_t y = 0; y < n; ++y) {
    for (std::size_t x = 0; x < n; ++x) {
      const double d = depth[y * n + x];
      const auto at = [&](std::size_t i, std::size_t j) { return depth[(j % n) * n + i % n]; };
      const double sx = -(at(x + 1, y) - at(x + n - 1, y)) / (2 * cell_mm);
      const double sy = -(at(x, y + n - 1) - at(x, y + 1)) / (2 * cell_mm);
      const Direction normal = normal_of_slope(sx, sy);
      maps.normal.push_back(
          {static_cast<float>(normal.x), static_cast<float>(normal.y), static_cast<float>(normal.z)});
      using corrosion::Regime;
      const Regime regime = d > o.hole_depth_mm ? Regime::kHole : d > 0 ? Regime::kRust : Regime::kMetal;
      maps.regime.push_back(regime);
      maps.metalness.push_back(regime == Regime::kMetal ? 1.0F : 0.0F);
      const auto deep = static_cast<float>(std::min(d / 0.3, 1.0));
      maps.albedo.push_back(regime == Regime::kMetal
                                ? corrosion::Rgb{0.53F, 0.51F, 0.5F}
                                : corrosion::Rgb{0.3F - 0.2F * deep, 0.13F - 0.08F * deep, 0.05F});
      maps.roughness.push_back(regime == Regime::kMetal ? 0.15F : 0.4F + 0.3F * deep);
      maps.porosity.push_back(regime == Regime::kMetal ? 0.0F : 0.1F + 0.4F * deep);
      maps.opacity.push_back(regime == Regime::kHole ? 0.0F : 1.0F);
    }
  }
  return maps;
}

/// The sum over cells of corrosion.md 5.2 with the convention of spot_brdf.h, cell by cell from the formulas.
inline Values cell_sum(std::span<const SheetCell> cells, const TexturedSheet& sheet, const Direction& wi,
                       const Direction& wo) {
  namespace formulas = reflectance::formulas;
  Values sum{};
  double shown_i = 0;
  double shown_o = 0;
  for (const SheetCell& cell : cells) {
    const Direction n = normal_of_slope(cell.slope_x, cell.slope_y);
    const FacetFrame frame = facet_frame(n);
    const Direction i = to_facet(wi, frame);
    const Direction o = to_facet(wo, frame);
    shown_i += cell.weight * std::max(i.z, 0.0) / n.z;
    shown_o += cell.weight * std::max(o.z, 0.0) / n.z;
    if (!(i.z > 0 && o.z > 0)) {
      continue;
    }
    const formulas::Geometry g = formulas::make_geometry(i, o);
    const double both = cell.weight * i.z * o.z / n.z;
    const double metal = formulas::ggx_lobe(sheet.optics().metal_alpha, g);
    const double rust = formulas::oren_nayar(kRustSigmaRad, g) * (1 - 0.092 * cell.coat);
    const double coat = cell.coat * formulas::dielectric_fresnel(kCoatIndex, g.cos_d) *
                        formulas::ggx_lobe(cell.coat_alpha, g);
    for (std::size_t c = 0; c < 3; ++c) {
      const double f =
          cell.metal * metal * formulas::conductor_fresnel(sheet.metal_n()[c], sheet.metal_k()[c], g.cos_d) +
          cell.rust * (rust * cell.albedo[c] + coat) +
          (1 - cell.metal - cell.rust) * sheet.optics().backing / kPi;
      sum[c] += both * f;
    }
  }
  for (double& value : sum) {
    value /= std::max(shown_i, wi.z) * std::max(shown_o, wo.z);
  }
  return sum;
}

inline std::shared_ptr<const TexturedSheet> made_sheet(const MadeOptions& options,
                                                       const SheetOptics& optics = {}) {
  auto sheet = TexturedSheet::make(made_maps(options), options.extent_mm, optics);
  return sheet ? *sheet : nullptr;
}

}  // namespace scatter::simulator::test
