// The search for the best parameters from one start (Ceres).
#pragma once

#include <span>
#include <stop_token>

#include "host_sdk/error/error.h"
#include "host_sdk/reflectance/fitting/fit_data.h"

namespace scatter::reflectance {

struct SearchOptions {
  int max_iterations = 60;
  double tolerance = 1e-10;  ///< Relative change of the cost that ends it.
  /// Slopes of the residual's curve, frozen: plane per channel, root_weight included. Empty: the
  /// curved residual itself. With them the residual is slope * (m - f), whose minimum is not biased
  /// by the curve.
  std::span<const double> frozen_slope = {};
  std::stop_token stop = {};
};

/// Levenberg-Marquardt within the family's bounds; `point` is the start and becomes the end.
/// Returns   the final cost: half the weighted sum of squared residuals.
/// Errors    kAborted: stopped; kInternal: the residual is not finite at the start.
[[nodiscard]] Result<double> search(const FitData& data, const FitFamily& family,
                                    const SearchOptions& options, FitPoint& point);

/// Slopes of the residual's curve at a point, times root_weight: plane per channel.
[[nodiscard]] std::vector<double> slopes(const FitData& data, const FitFamily& family, const FitPoint& point);

}  // namespace scatter::reflectance
