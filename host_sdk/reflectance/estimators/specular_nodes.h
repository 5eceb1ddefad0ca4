// Directions of the nodes of a grid about the mirror direction.
#pragma once

#include <vector>

#include "host_sdk/reflectance/specular_grid_brdf.h"

namespace scatter::reflectance {

/// omega_o of every node of one incidence, in the order [azimuth * radials + radial]; those below the
/// horizon too. Uses only the axes and the type of the content.
[[nodiscard]] std::vector<Direction> specular_nodes(const SpecularGridBrdf::Content& content, double theta_i,
                                                    double phi_i);

}  // namespace scatter::reflectance
