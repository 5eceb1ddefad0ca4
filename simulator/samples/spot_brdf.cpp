#include "simulator/samples/spot_brdf.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace scatter::simulator {
namespace {

using reflectance::Direction;
using reflectance::kModelChannels;
using reflectance::Origin;

constexpr std::size_t kStep = 64;

}  // namespace

SpotBrdf::SpotBrdf(std::span<const Facet> facets) {
  for (const Facet& facet : facets) {
    const FacetFrame level = facet_frame(facet.normal);
    const double c = std::cos(facet.turn_rad);
    const double s = std::sin(facet.turn_rad);
    const Direction& x = level[0];
    const Direction& y = level[1];
    const FacetFrame turned{Direction{c * x.x + s * y.x, c * x.y + s * y.y, c * x.z + s * y.z},
                            Direction{c * y.x - s * x.x, c * y.y - s * x.y, c * y.z - s * x.z}, level[2]};
    facets_.push_back({turned, facet.weight / facet.normal.z, facet.material});
  }
}

/// P(w).
double SpotBrdf::shown(const Direction& w) const noexcept {
  double area = 0;
  for (const Part& facet : facets_) {
    area += facet.area * std::max(dot(facet.frame[2], w), 0.0);
  }
  return std::max(area, w.z);
}

Origin SpotBrdf::eval(const Direction& omega_i, const Direction& omega_o,
                      std::span<double> f_per_sr) const noexcept {
  Origin origin = Origin::kInvalid;
  eval_batch(omega_i, {&omega_o, 1}, f_per_sr, {&origin, 1});
  return origin;
}

void SpotBrdf::eval_batch(const Direction& omega_i, std::span<const Direction> omega_o,
                          std::span<double> f_per_sr, std::span<Origin> origin) const noexcept {
  std::array<Direction, kStep> local;
  std::array<double, kStep> area;
  std::array<double, kStep * kModelChannels> f;
  const double shown_i = omega_i.z > 0 ? shown(omega_i) : 0;
  for (std::size_t first = 0; first < omega_o.size(); first += kStep) {
    const std::size_t count = std::min(kStep, omega_o.size() - first);
    const std::span out = f_per_sr.subspan(first * kModelChannels, count * kModelChannels);
    std::ranges::fill(out, 0.0);
    area.fill(0.0);
    for (const Part& facet : facets_) {
      const Direction in = to_facet(omega_i, facet.frame);
      for (std::size_t k = 0; k < count; ++k) {
        local[k] = to_facet(omega_o[first + k], facet.frame);
        area[k] += facet.area * std::max(local[k].z, 0.0);
      }
      if (facet.material == nullptr || !(in.z > 0) || !(shown_i > 0)) {
        continue;
      }
      facet.material->eval_batch(in, std::span(local).first(count),
                                 std::span(f).first(count * kModelChannels), {});
      const double factor = facet.area * in.z;
      for (std::size_t k = 0; k < count; ++k) {
        for (std::size_t c = 0; c < kModelChannels; ++c) {
          // Materials give 0 where the facet turns away.
          out[k * kModelChannels + c] += factor * local[k].z * f[k * kModelChannels + c];
        }
      }
    }
    for (std::size_t k = 0; k < count; ++k) {
      const double cosine = omega_o[first + k].z;
      const bool valid = shown_i > 0 && cosine > 0;
      const double scale = valid ? 1.0 / (shown_i * std::max(area[k], cosine)) : 0.0;
      for (std::size_t c = 0; c < kModelChannels; ++c) {
        out[k * kModelChannels + c] *= scale;
      }
      if (!origin.empty()) {
        origin[first + k] = valid ? Origin::kMeasured : Origin::kInvalid;
      }
    }
  }
}

}  // namespace scatter::simulator
