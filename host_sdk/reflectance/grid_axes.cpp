#include <algorithm>
#include <cmath>

#include "host_sdk/reflectance/grid_lookup.h"

namespace scatter::reflectance {
namespace {

/// Steps that differ by less are equal: rounding of degrees in files [rad].
constexpr double kEqualSteps = 1e-10;
/// Slices of an axis per node; most then hold at most one node.
constexpr std::size_t kSlicesPerNode = 4;

}  // namespace

void IncidenceAxis::set(std::span<const double> angles, std::span<const double> column_offsets) {
  count = angles.size();
  const std::size_t padded = (count + kPadding - 1) / kPadding * kPadding;
  for (auto* quantity : {&theta, &cosine, &sine, &inverse_gap, &column_offset}) {
    quantity->assign(padded, 0.0F);
  }
  one_by_one.clear();
  for (std::size_t p = 0; p < count; ++p) {
    const double gap = p + 1 < count ? angles[p + 1] - angles[p] : 0;
    const Incidence& one = one_by_one.emplace_back(Incidence{
        angles[p], std::cos(angles[p]), std::sin(angles[p]), gap > 0 ? 1 / gap : 0, column_offsets[p]});
    theta[p] = static_cast<float>(one.theta);
    cosine[p] = static_cast<float>(one.cosine);
    sine[p] = static_cast<float>(one.sine);
    inverse_gap[p] = static_cast<float>(one.inverse_gap);
    column_offset[p] = static_cast<float>(one.column_offset);
  }
}

void AngleAxis::set(std::vector<double> angles) {
  nodes = std::move(angles);
  const std::size_t steps = nodes.size() - 1;
  const double length = nodes.back() - nodes.front();
  if (steps == 0) {
    equal_steps = true;
    per_rad = 0;
    return;
  }
  per_rad = static_cast<double>(steps) / length;
  equal_steps = true;
  for (std::size_t k = 0; k <= steps; ++k) {
    const double expected = nodes.front() + static_cast<double>(k) / per_rad;
    equal_steps = equal_steps && std::abs(nodes[k] - expected) < kEqualSteps;
  }
  if (equal_steps) {
    return;
  }
  const std::size_t slices = kSlicesPerNode * nodes.size();
  guess_per_rad = static_cast<double>(slices) / length;
  // One more than there are slices: rounding can put the end of the axis past the last one.
  std::size_t node = 0;
  for (std::size_t s = 0; s <= slices; ++s) {
    const double from = nodes.front() + static_cast<double>(s) / guess_per_rad;
    while (node < steps && nodes[node + 1] < from) {
      ++node;
    }
    guess.push_back(static_cast<std::uint32_t>(node));
  }
}

}  // namespace scatter::reflectance
