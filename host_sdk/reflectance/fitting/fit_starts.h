// Where searches start: a scan of the shape parameters with the best coefficients for each.
#pragma once

#include <cstddef>
#include <vector>

#include "host_sdk/reflectance/fitting/fit_data.h"

namespace scatter::reflectance {

/// The best points of the scan (fit_terms.h), best first, at most `wanted`. The coefficients are the
/// bounded linear least squares solution under the residual's slope at the samples.
/// Cost      one evaluation of the terms and 3 x 3 systems per point of the scan.
[[nodiscard]] std::vector<FitPoint> starts(const FitData& data, const FitFamily& family, std::size_t wanted);

}  // namespace scatter::reflectance
