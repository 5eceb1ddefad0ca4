// Any BRDF as a grid about the normal, for pictures and formats that are grids.
#pragma once

#include <memory>
#include <vector>

#include "host_sdk/error/error.h"
#include "host_sdk/reflectance/grid_brdf.h"
#include "tools/plot/curves.h"

namespace scatter::cli {

/// The BRDF itself when it is a grid with these incidences, else sampled in 1 deg steps to the horizon.
/// Errors   of sample_on_grid.
[[nodiscard]] Result<std::shared_ptr<const reflectance::GridBrdf>> grid_of(
    const reflectance::Brdf& brdf, const std::vector<plot::Incidence>& incidences);

}  // namespace scatter::cli
