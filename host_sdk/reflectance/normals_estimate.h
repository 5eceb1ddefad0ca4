// Density of microfacet normals from a BRDF's own values. Internal to reflectance.
#pragma once

#include <string>

#include "host_sdk/error/error.h"
#include "host_sdk/reflectance/bilinear_warp.h"
#include "host_sdk/reflectance/brdf.h"

namespace scatter::reflectance {

/// Nodes as in adaptive_brdf.h: column = elevation, row = azimuth.
struct NormalsEstimate {
  BilinearTables ndf;    ///< D [1/sr], scaled so that sigma is 1 at the normal.
  BilinearTables sigma;  ///< Projected area: integral of D(m) max(0, m . omega) over m.
  std::string source;    ///< "retro-reflection" or "half vectors".
};

/// Angles of a node of the tables [rad].
[[nodiscard]] inline double theta_at(double x) noexcept {
  return x * x * kPi / 2;
}
[[nodiscard]] inline double phi_at(double y) noexcept {
  return (2 * y - 1) * kPi;
}

/// theta_i: incidences to look at where the retro-reflection is not known [rad].
/// Range     columns, and rows where the material is not isotropic, at least 4.
/// Errors    kFailedPrecondition: no direction has a value above 0.
/// Source    Dupuy 2015, "Extracting microfacet-based BRDF parameters from arbitrary materials with
///           power iterations", eq. 8; Dupuy and Jakob 2018, section 4.1.
[[nodiscard]] Result<NormalsEstimate> estimate_normals(const Brdf& brdf, std::span<const double> theta_i,
                                                       std::size_t columns, std::size_t rows, bool isotropic);

}  // namespace scatter::reflectance
