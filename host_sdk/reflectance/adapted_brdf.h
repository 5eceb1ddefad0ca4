// Any BRDF put into the adaptive parameterization.
#pragma once

#include <cstddef>
#include <map>
#include <string>
#include <vector>

#include "host_sdk/error/error.h"
#include "host_sdk/reflectance/adaptive_brdf.h"

namespace scatter::reflectance {

struct AdaptOptions {
  /// Incidences of the tables [rad], ascending; empty: 0 10 .. 80 89 deg and those of a grid.
  std::vector<double> theta_i = {};
  /// Azimuths of the incidences over a whole turn, both ends included. 1: isotropic; else 5..361.
  /// 0: 1, or 17 for a grid of several sample rotations.
  std::size_t azimuths = 0;
  std::size_t resolution = 32;  ///< Nodes of spectra and luminance per side, 4..256.
  /// Added to those of a grid, whose keys it replaces.
  std::map<std::string, std::string> metadata = {};
  std::size_t normals_resolution = 128;  ///< Nodes of ndf and vndf per side, 16..512.
};

/// Tables whose values at the nodes are those of `brdf`; between nodes, warped, bilinear.
///
/// The density of normals comes from the retro-reflection f(omega, omega) by power iteration
/// (Dupuy 2015, eq. 8; Dupuy and Jakob 2018, section 4.1). Where the data do not know the
/// retro-reflection (an instrument's blind spots), it comes from 4 f cos_i cos_o over the half
/// vectors of all incidences instead. It only decides where nodes lie and which factor is taken
/// out of the values: f is stored either way. Metadata "adaptive_ndf" says which it was.
/// Nodes below the horizon continue f beyond it, so that f cos(theta_o) passes through 0 there;
/// they, and those without a value, are marked as not valid.
/// Errors  kInvalidArgument: BTDF, options out of range; kFailedPrecondition: no direction has a
///         value.
/// Cost    one evaluation per node: 10,240 for an isotropic material.
[[nodiscard]] Result<AdaptiveBrdf> adapt(const Brdf& brdf, const AdaptOptions& options = {});

}  // namespace scatter::reflectance
