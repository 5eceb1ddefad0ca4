// Any Brdf put onto a grid about the normal.
#pragma once

#include <cstddef>
#include <vector>

#include "host_sdk/error/error.h"
#include "host_sdk/reflectance/brdf.h"
#include "host_sdk/reflectance/grid_brdf.h"

namespace scatter::reflectance {

/// The grid wanted. Default: the instrument's incidences, the whole hemisphere in 1 deg steps.
struct GridLayout {
  struct Incidence {
    double rotation_rad = 0;
    double theta_i = 0;  ///< [rad]
    double phi_i = 0;    ///< [rad]
  };
  std::vector<Incidence> incidences{{0, 0, 0}, {0, radians(20), 0}, {0, radians(40), 0}, {0, radians(60), 0}};
  std::size_t theta_count = 91;
  std::size_t phi_count = 360;
  double theta_step = kPi / 180.0;  ///< [rad]

  /// Incidences and steps of an existing grid.
  [[nodiscard]] static GridLayout of(const GridBrdf& grid);
};

/// Values and uncertainties of `brdf` at the nodes of a layout; origins as `brdf` gives them.
/// Float rounding is the only loss at the nodes. A Dirac component is not in the result.
/// Errors  kInvalidArgument: the layout is no grid.
[[nodiscard]] Result<GridBrdf> sample_on_grid(const Brdf& brdf, const GridLayout& layout);

}  // namespace scatter::reflectance
