// Where a BRDF has been measured: what the links of a chain need to know about its data.
#pragma once

#include <optional>
#include <vector>

#include "host_sdk/reflectance/brdf.h"

namespace scatter::reflectance {

/// Incidences and outgoing angles that carry data.
struct Extent {
  std::vector<double> theta_i;    ///< Stored incidences, ascending [rad]; empty: any (a model).
  std::optional<double> azimuth;  ///< Of the light in the data [rad], when there is only one: the sample is
                                  ///< then taken as isotropic and questions are turned there.
  double theta_o_to = kPi / 2;    ///< Largest theta_o with data about the normal [rad], over all incidences.
};

/// Of the data at the bottom of a chain: grids and scattered samples say it, everything else is
/// taken as known everywhere. Nodes that are invalid or extrapolated are no data; of a
/// SpecularGridBrdf theta_o_to is pi/2, since its rim is no circle about the normal. Scattered samples have
/// incidences when at least 8 sites share each on average, else none.
/// Cost  one pass over the origins.
[[nodiscard]] Extent extent_of(const Brdf& brdf);

}  // namespace scatter::reflectance
