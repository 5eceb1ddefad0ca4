// What the scatter of the residuals says about the parameters.
#pragma once

#include <span>
#include <vector>

#include "host_sdk/reflectance/fitting/fit_data.h"

namespace scatter::reflectance {

struct ParameterUncertainty {
  /// Shape parameters first, then coefficients [channel][term]; in what is searched (the logarithm
  /// where the family says so).
  std::vector<double> sigma = {};
  std::vector<Standing> standing = {};
  /// Covariance of the same, row after row; empty when there are more than 64 parameters.
  std::vector<double> covariance = {};
};

/// Covariance at the minimum by the sandwich estimator: bread from the slopes, filling from the
/// squared residuals, those of one sample taken together over its channels (they may err together).
/// Holds for independent samples of any, also unequal, noise. Parameters at bounds are held there.
/// `slope` as in SearchOptions::frozen_slope; the residual is the linear one.
/// Source  Huber 1967, White 1980 (HC1).
[[nodiscard]] ParameterUncertainty parameter_uncertainty(const FitData& data, const FitFamily& family,
                                                         const FitPoint& point,
                                                         std::span<const double> slope);

}  // namespace scatter::reflectance
