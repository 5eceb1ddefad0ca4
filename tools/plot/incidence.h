// What a picture is drawn of: BRDFs with their names, and the directions of light.
#pragma once

#include <string>
#include <vector>

#include "host_sdk/reflectance/brdf.h"

namespace scatter::plot {

struct NamedBrdf {
  std::string name;
  const reflectance::Brdf* brdf = nullptr;  ///< Not owned; not null.
};

/// Light direction of one panel [rad].
struct Incidence {
  double theta_i = 0;
  double phi_i = 0;
};

/// Incidences of a grid, at every rotation of the sample; 0, 20, 40 and 60 deg for everything else.
[[nodiscard]] std::vector<Incidence> incidences_of(const reflectance::Brdf& brdf);

/// At most `limit` (1 or more) places of a list of `count`, evenly spaced, the first and the last among them.
[[nodiscard]] std::vector<std::size_t> evenly_spaced(std::size_t count, std::size_t limit);

/// Whether the light comes from more than one azimuth, so that theta_i alone names no incidence.
[[nodiscard]] bool turned(const std::vector<Incidence>& incidences);

/// "θᵢ = 20°", with its azimuth where `turned`.
[[nodiscard]] std::string incidence_name(const Incidence& incidence, bool turned);

}  // namespace scatter::plot
