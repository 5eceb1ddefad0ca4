// A fit in both languages of the command line.
#pragma once

#include <optional>

#include "host_sdk/reflectance/fitting/fit.h"
#include "tools/scatter/engine_fit.h"
#include "tools/scatter/verb.h"

namespace scatter::cli {

/// scores: of the cross-validation, empty when the model was named; engines: where there are any.
[[nodiscard]] Answer fit_report(const reflectance::FitResult& result,
                                const std::vector<reflectance::FamilyScore>& scores,
                                const std::optional<EngineFits>& engines);

}  // namespace scatter::cli
