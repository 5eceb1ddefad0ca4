// The sphere cut into cells, and integrals over them: expected counts for chi-square tests.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include "host_sdk/reflectance/direction.h"

namespace scatter::reflectance::test {

inline constexpr std::size_t kRows = 24;     ///< In theta over 0..pi.
inline constexpr std::size_t kColumns = 36;  ///< In phi.

/// Cuts of a cell: densities of mirrored facets grow like 1/distance towards the light; and those to
/// follow the border of a density's support.
inline constexpr int kDepth = 12;
inline constexpr int kBorderDepth = 5;

inline std::size_t cell_of(const Direction& w) {
  const auto row = static_cast<std::size_t>(theta_of(w) / kPi * static_cast<double>(kRows));
  const auto column = static_cast<std::size_t>(phi_of(w) / (2 * kPi) * static_cast<double>(kColumns));
  return std::min(row, kRows - 1) * kColumns + std::min(column, kColumns - 1);
}

/// Integral of density(omega) over theta0..theta1, phi0..phi1: Gauss of order 4 against 2, cut into four
/// until they agree.
template <typename Density>
double integral(const Density& density, double theta0, double theta1, double phi0, double phi1, int depth) {
  constexpr std::array<double, 4> kNode4{-0.861136311594052575, -0.339981043584856265, 0.339981043584856265,
                                         0.861136311594052575};
  constexpr std::array<double, 4> kWeight4{0.347854845137453857, 0.652145154862546143, 0.652145154862546143,
                                           0.347854845137453857};
  constexpr std::array<double, 2> kNode2{-0.577350269189625765, 0.577350269189625765};
  constexpr std::array<double, 2> kWeight2{1, 1};
  const double half_theta = (theta1 - theta0) / 2;
  const double half_phi = (phi1 - phi0) / 2;
  const auto rule = [&](const auto& node, const auto& weight) {
    double sum = 0;
    for (std::size_t j = 0; j < node.size(); ++j) {
      const double theta = theta0 + half_theta * (1 + node[j]);
      for (std::size_t i = 0; i < node.size(); ++i) {
        sum += weight[j] * weight[i] * std::sin(theta) *
               density(from_spherical(theta, phi0 + half_phi * (1 + node[i])));
      }
    }
    return sum * half_theta * half_phi;
  };
  // A border of the density's support may pass between the nodes: the corners tell.
  const auto is_positive = [&](double theta, double phi) { return density(from_spherical(theta, phi)) > 0; };
  const bool corner = is_positive(theta0, phi0);
  const bool border = depth > kDepth - kBorderDepth &&
                      (corner != is_positive(theta0, phi1) || corner != is_positive(theta1, phi0) ||
                       corner != is_positive(theta1, phi1));
  const double fine = rule(kNode4, kWeight4);
  if (depth == 0 || (!border && std::abs(fine - rule(kNode2, kWeight2)) < 2e-7)) {
    return fine;
  }
  const double theta = (theta0 + theta1) / 2;
  const double phi = (phi0 + phi1) / 2;
  return integral(density, theta0, theta, phi0, phi, depth - 1) +
         integral(density, theta0, theta, phi, phi1, depth - 1) +
         integral(density, theta, theta1, phi0, phi, depth - 1) +
         integral(density, theta, theta1, phi, phi1, depth - 1);
}

/// One integral per cell.
template <typename Density>
std::vector<double> integrals(const Density& density) {
  std::vector<double> out;
  for (std::size_t row = 0; row < kRows; ++row) {
    for (std::size_t column = 0; column < kColumns; ++column) {
      const double theta_step = kPi / static_cast<double>(kRows);
      const double phi_step = 2 * kPi / static_cast<double>(kColumns);
      const double theta = static_cast<double>(row) * theta_step;
      const double phi = static_cast<double>(column) * phi_step;
      out.push_back(integral(density, theta, theta + theta_step, phi, phi + phi_step, kDepth));
    }
  }
  return out;
}

/// Probability that chance alone deviates so far from `expected`, by Pearson's chi-square; cells that
/// expect fewer than five counts are pooled. Wilson and Hilferty 1931 for the distribution.
inline double chi_square_p(const std::vector<double>& counts, const std::vector<double>& expected) {
  double chi2 = 0;
  double cells = 0;
  double pool_count = 0;
  double pool_expected = 0;
  for (std::size_t k = 0; k < counts.size(); ++k) {
    if (expected[k] < 5) {
      pool_count += counts[k];
      pool_expected += expected[k];
    } else {
      chi2 += (counts[k] - expected[k]) * (counts[k] - expected[k]) / expected[k];
      cells += 1;
    }
  }
  if (pool_expected >= 5) {
    chi2 += (pool_count - pool_expected) * (pool_count - pool_expected) / pool_expected;
    cells += 1;
  } else if (pool_count > 25) {
    return 0;  // Many draws where hardly any can be.
  }
  const double freedom = cells - 1;
  if (freedom < 1) {
    return 1;
  }
  const double v = 2 / (9 * freedom);
  const double z = (std::cbrt(chi2 / freedom) - (1 - v)) / std::sqrt(v);
  return 0.5 * std::erfc(z / std::sqrt(2.0));
}

}  // namespace scatter::reflectance::test
