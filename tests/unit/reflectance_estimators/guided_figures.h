// The figures of reflectance.md 6: how far an interpolation is from the truth at one incidence.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>
#include <vector>

#include "host_sdk/reflectance/brdf.h"

namespace scatter::reflectance::test {

struct Figures {
  double mean = 0;        ///< Relative error, by solid angle.
  double p99 = 0;         ///< 99th percentile, likewise.
  double peak_ratio = 0;  ///< At the place of the true peak.
};

/// Channel 0 of both, over a 1 deg grid about the normal to theta_o = 75 deg; directions that `truth`
/// extrapolates or that hold no light count for nothing.
inline Figures figures_of(const Brdf& estimate, const Brdf& truth, double theta_i) {
  const Direction omega_i = from_spherical(theta_i, 0);
  std::vector<Direction> nodes;
  std::vector<double> weight;
  for (int row = 0; row <= 75; ++row) {
    for (int column = 0; column < 360; ++column) {
      nodes.push_back(from_spherical(radians(row), radians(column)));
      weight.push_back(std::cos(radians(std::max(0.0, row - 0.5))) - std::cos(radians(row + 0.5)));
    }
  }
  std::vector<double> estimated(nodes.size() * estimate.channels());
  std::vector<double> true_value(nodes.size() * truth.channels());
  std::vector<Origin> origin(nodes.size());
  estimate.eval_batch(omega_i, nodes, estimated, {});
  truth.eval_batch(omega_i, nodes, true_value, origin);
  std::vector<std::pair<double, double>> relative;
  Figures figures;
  double total = 0;
  double peak = 0;
  for (std::size_t k = 0; k < nodes.size(); ++k) {
    const double f = true_value[k * truth.channels()];
    const double found = estimated[k * estimate.channels()];
    if (origin[k] == Origin::kInvalid || origin[k] == Origin::kExtrapolated || !(f > 0)) {
      continue;
    }
    if (f > peak) {
      peak = f;
      figures.peak_ratio = found / f;
    }
    relative.emplace_back(std::abs(found / f - 1), weight[k]);
    figures.mean += relative.back().first * weight[k];
    total += weight[k];
  }
  figures.mean /= total;
  std::ranges::sort(relative);
  double reached = 0;
  for (const auto& [error, share] : relative) {
    reached += share;
    if (reached >= 0.99 * total) {
      figures.p99 = error;
      break;
    }
  }
  return figures;
}

}  // namespace scatter::reflectance::test
