// A fitted model as the text that make_model reads.
#pragma once

#include <string>

#include "host_sdk/reflectance/fitting/fitted_brdf.h"

namespace scatter::reflectance {

/// Empty when the spec language cannot hold it: other channel counts than 1 and 3, glTF.
[[nodiscard]] std::string model_spec(const FittedBrdf::Parameters& parameters);

}  // namespace scatter::reflectance
