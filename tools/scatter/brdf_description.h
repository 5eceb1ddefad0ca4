// Figures of one BRDF or BTDF, for `info` and `inspect`.
#pragma once

#include <string>

#include "host_sdk/reflectance/brdf.h"
#include "tools/scatter/verb.h"

namespace scatter::cli {

[[nodiscard]] Answer describe_brdf(const std::string& name, const reflectance::Brdf& brdf);

}  // namespace scatter::cli
