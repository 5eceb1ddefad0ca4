#include "host_sdk/reflectance/fitting/fit_starts.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "host_sdk/reflectance/fitting/fit_terms.h"

namespace scatter::reflectance {
namespace {

constexpr std::size_t kMost = 3;  // coefficients of a channel

/// Minimum of x'Hx/2 - g'x with 0 <= x <= 1, by coordinates; H positive semidefinite.
void solve_bounded(const std::array<double, kMost * kMost>& h, const std::array<double, kMost>& g,
                   std::size_t n, double* x) {
  for (int sweep = 0; sweep < 100; ++sweep) {
    double moved = 0;
    for (std::size_t i = 0; i < n; ++i) {
      double rest = g[i];
      for (std::size_t j = 0; j < n; ++j) {
        rest -= j == i ? 0 : h[i * kMost + j] * x[j];
      }
      const double to = h[i * kMost + i] > 0 ? std::clamp(rest / h[i * kMost + i], 0.0, 1.0) : 0.0;
      moved = std::max(moved, std::abs(to - x[i]));
      x[i] = to;
    }
    if (moved < 1e-7) {
      return;
    }
  }
}

/// Every combination of the scan values; of two equal lobes only those with the narrower one first.
std::vector<std::vector<double>> scan_points(const FitFamily& family) {
  const std::vector<ShapeParameter> parameters = shape_parameters(family);
  std::vector<std::vector<double>> points{{}};
  for (const ShapeParameter& parameter : parameters) {
    std::vector<std::vector<double>> longer;
    for (const auto& point : points) {
      for (const double value : parameter.scan) {
        longer.push_back(point);
        longer.back().push_back(value);
      }
    }
    points = std::move(longer);
  }
  if (family.lobes.size() == 2 && family.lobes[0] == family.lobes[1]) {
    std::vector<std::size_t> widths;
    for (std::size_t p = 0; p < parameters.size(); ++p) {
      if (parameters[p].logarithmic) {
        widths.push_back(p);
      }
    }
    const bool exponent = family.lobes[0] == FitLobe::kLafortune;  // large is narrow
    std::erase_if(points, [&](const auto& point) {
      const double first = point[widths[0]];
      const double second = point[widths[1]];
      return exponent ? first <= second : first >= second;
    });
  }
  return points;
}

}  // namespace

std::vector<FitPoint> starts(const FitData& data, const FitFamily& family, std::size_t wanted) {
  const std::size_t n = data.size();
  const std::size_t terms = coefficients(family).size();
  // Weight of the linear residual at each sample: the slope of the curve at the sample itself.
  std::vector<double> weight(n * data.channels);
  for (std::size_t c = 0; c < data.channels; ++c) {
    for (std::size_t k = 0; k < n; ++k) {
      const std::size_t at = c * n + k;
      double slope = 0;
      if (data.residual == Residual::kUncertainty) {
        slope = data.inverse_sigma[at];
      } else {
        const double cosine = data.geometry[k].cos_o;
        const double floored = std::max(data.f_per_sr[at] * cosine, 0.0) + data.floor[c];
        slope = cosine * transformed_slope(data.residual, floored);
      }
      weight[at] = slope * slope * data.root_weight[k] * data.root_weight[k];
    }
  }
  struct Candidate {
    double rms = 0;
    FitPoint point;
  };
  std::vector<Candidate> candidates;
  std::vector<double> value(n * (1 + terms));
  for (auto& shape : scan_points(family)) {
    evaluate_terms(family, shape, data.geometry, value);
    FitPoint point{std::move(shape), std::vector<double>(data.channels * terms, 0.0)};
    for (std::size_t c = 0; c < data.channels; ++c) {
      std::array<double, kMost * kMost> h{};
      std::array<double, kMost> g{};
      for (std::size_t k = 0; k < n; ++k) {
        const double* term = value.data() + k * (1 + terms);
        const double w = weight[c * n + k];
        const double y = data.f_per_sr[c * n + k] - term[0];
        for (std::size_t i = 0; i < terms; ++i) {
          g[i] += w * term[1 + i] * y;
          for (std::size_t j = 0; j <= i; ++j) {
            h[i * kMost + j] += w * term[1 + i] * term[1 + j];
          }
        }
      }
      for (std::size_t i = 0; i < terms; ++i) {
        for (std::size_t j = i + 1; j < terms; ++j) {
          h[i * kMost + j] = h[j * kMost + i];
        }
      }
      solve_bounded(h, g, terms, point.coefficient.data() + c * terms);
      // A search that starts on a bound may stay there; the smallest step inside frees it.
      for (std::size_t i = 0; i < terms; ++i) {
        double& x = point.coefficient[c * terms + i];
        x = std::clamp(x, 1e-4, 1 - 1e-4);
      }
    }
    candidates.push_back({rms_residual(data, family, point), std::move(point)});
  }
  std::ranges::stable_sort(candidates, {}, &Candidate::rms);
  std::vector<FitPoint> best;
  for (Candidate& candidate : candidates) {
    if (best.size() < wanted && std::isfinite(candidate.rms)) {
      best.push_back(std::move(candidate.point));
    }
  }
  return best;
}

}  // namespace scatter::reflectance
