// Directional-hemispherical reflectance (or transmittance).
#pragma once

#include <cstddef>
#include <vector>

#include "host_sdk/reflectance/brdf.h"
#include "host_sdk/reflectance/grid_brdf.h"

namespace scatter::reflectance {

/// Which nodes of a grid count.
enum class Region : std::uint8_t {
  kMeasured,  ///< Origin measured only.
  kAll,       ///< Everything but invalid.
};

/// a(omega_i) = integral of f cos(theta_o) d omega_o, 0..1 where energy is conserved.
struct Albedo {
  std::vector<double> value;  ///< One per channel; without the Dirac component.
  std::vector<double> dirac;  ///< One per channel, 0 where there is none.
  double error = 0;           ///< Estimated absolute error of `value`, largest channel.
  bool converged = true;      ///< False when `max_evaluations` ended it before `tolerance`.
};

struct AlbedoOptions {
  double tolerance = 1e-5;  ///< Absolute, on every channel.
  std::size_t max_evaluations = 2'000'000;
};

/// By adaptive cubature over (theta_o, phi_o), refined towards the mirror (or straight)
/// direction from the start, so that lobes of 0.1 deg are found there; elsewhere first cells of at most
/// 0.1 rad (three steps of a grid, down to 0.02 rad). Invalid directions count as 0.
/// Cost     32,000 evaluations at the least, 230,000 on a grid of 1 deg, in batches of 34.
[[nodiscard]] Albedo albedo(const Brdf& brdf, const Direction& omega_i, const AlbedoOptions& options = {});

/// Sum over the nodes of one part: f cos(theta_o) times the node's solid angle, per channel.
[[nodiscard]] std::vector<double> grid_albedo(const GridBrdf& grid, std::size_t part, Region region);

}  // namespace scatter::reflectance
