#include "host_sdk/reflectance/peak.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

namespace scatter::reflectance {
namespace {

constexpr double kDistinct = 1.5;  ///< Top over median.
constexpr double kShoulder = 0.8;  ///< Fitted part of the lobe, share of its top.
constexpr double kSearch = 20.0;   ///< Where the shoulder may lie [deg].
constexpr double kSmallest = 1.5;  ///< Fewest nodes that determine the fit: radius in 1 deg steps [deg].
constexpr double kLargest = 10.0;  ///< Beyond this a quadratic no longer follows any lobe [deg].
constexpr double kCovered = 0.8;   ///< Of the fitted disc by nodes; less means an edge.
constexpr int kRounds = 12;
constexpr double kStill = 1e-3;  ///< Shift at which the fit has settled, in radii.
constexpr std::size_t kTerms = 6;

using Row = std::array<double, kTerms>;

/// Solves the symmetric positive definite system in place by Cholesky; false when it is not.
bool solve(std::array<Row, kTerms>& m, Row& b) {
  for (std::size_t j = 0; j < kTerms; ++j) {
    const double before = m[j][j];
    for (std::size_t k = 0; k < j; ++k) {
      m[j][j] -= m[j][k] * m[j][k];
    }
    if (!(m[j][j] > 1e-12 * before)) {
      return false;
    }
    m[j][j] = std::sqrt(m[j][j]);
    for (std::size_t i = j + 1; i < kTerms; ++i) {
      for (std::size_t k = 0; k < j; ++k) {
        m[i][j] -= m[i][k] * m[j][k];
      }
      m[i][j] /= m[j][j];
    }
  }
  for (std::size_t i = 0; i < kTerms; ++i) {
    for (std::size_t k = 0; k < i; ++k) {
      b[i] -= m[i][k] * b[k];
    }
    b[i] /= m[i][i];
  }
  for (std::size_t i = kTerms; i-- > 0;) {
    for (std::size_t k = i + 1; k < kTerms; ++k) {
      b[i] -= m[k][i] * b[k];
    }
    b[i] /= m[i][i];
  }
  return true;
}

struct Top {
  Direction at;
  double height = 0;
  double shift = 0;  ///< From the centre of the fit, in radii.
};

/// One quadratic fit in the tangent plane at `centre`.
std::optional<Top> fit(std::span<const Direction> node, std::span<const double> solid_angle_sr,
                       std::span<const double> value, const Direction& centre, double radius) {
  const Direction side = std::abs(centre.z) < 0.9 ? Direction{0, 0, 1} : Direction{1, 0, 0};
  const Direction t = normalized(cross(side, centre));
  const Direction s = cross(centre, t);
  const double nearest_cos = std::cos(radius);
  std::array<Row, kTerms> m{};
  Row b{};
  double covered = 0;
  for (std::size_t n = 0; n < node.size(); ++n) {
    if (std::isnan(value[n]) || dot(node[n], centre) < nearest_cos) {
      continue;
    }
    const double u = dot(node[n], t) / radius;
    const double v = dot(node[n], s) / radius;
    const Row row{1, u, v, u * u, u * v, v * v};
    for (std::size_t i = 0; i < kTerms; ++i) {
      for (std::size_t k = 0; k <= i; ++k) {
        m[i][k] += solid_angle_sr[n] * row[i] * row[k];
      }
      b[i] += solid_angle_sr[n] * row[i] * value[n];
    }
    covered += solid_angle_sr[n];
  }
  if (covered < kCovered * kPi * radius * radius || !solve(m, b)) {
    return std::nullopt;
  }
  const double determinant = 4 * b[3] * b[5] - b[4] * b[4];
  if (!(b[3] < 0 && determinant > 0)) {
    return std::nullopt;
  }
  const double u = (b[4] * b[2] - 2 * b[5] * b[1]) / determinant;
  const double v = (b[4] * b[1] - 2 * b[3] * b[2]) / determinant;
  const Direction at =
      normalized({centre.x + radius * (u * t.x + v * s.x), centre.y + radius * (u * t.y + v * s.y),
                  centre.z + radius * (u * t.z + v * s.z)});
  return Top{at, b[0] + 0.5 * (b[1] * u + b[2] * v), std::hypot(u, v)};
}

double weighted_median(std::span<const double> weight, std::span<const double> value) {
  std::vector<std::pair<double, double>> sorted;
  double total = 0;
  for (std::size_t n = 0; n < value.size(); ++n) {
    if (!std::isnan(value[n])) {
      sorted.emplace_back(value[n], weight[n]);
      total += weight[n];
    }
  }
  std::ranges::sort(sorted);
  double below = 0;
  for (const auto& [v, w] : sorted) {
    below += w;
    if (below >= total / 2) {
      return v;
    }
  }
  return 0;
}

}  // namespace

std::optional<Peak> find_peak(std::span<const Direction> node, std::span<const double> solid_angle_sr,
                              std::span<const double> value, double radius) {
  std::size_t top = node.size();
  for (std::size_t n = 0; n < node.size(); ++n) {
    if (!std::isnan(value[n]) && (top == node.size() || value[n] > value[top])) {
      top = n;
    }
  }
  if (top == node.size() || !(value[top] > 0) ||
      value[top] < kDistinct * weighted_median(solid_angle_sr, value)) {
    return std::nullopt;
  }
  if (radius <= 0) {
    double shoulder_sr = 0;
    for (std::size_t n = 0; n < node.size(); ++n) {
      if (value[n] >= kShoulder * value[top] && dot(node[n], node[top]) > std::cos(radians(kSearch))) {
        shoulder_sr += solid_angle_sr[n];
      }
    }
    radius = std::clamp(std::sqrt(shoulder_sr / kPi), radians(kSmallest), radians(kLargest));
  }
  // Fitting again around the top found makes the result independent of which node was largest.
  Direction centre = node[top];
  double height = 0;
  double shift = 1;
  for (int round = 0; round < kRounds && shift > kStill; ++round) {
    const auto found = fit(node, solid_angle_sr, value, centre, radius);
    if (!found || found->shift > 1) {
      return std::nullopt;
    }
    centre = found->at;
    height = found->height;
    shift = found->shift;
  }
  return Peak{centre, height, radius};
}

}  // namespace scatter::reflectance
