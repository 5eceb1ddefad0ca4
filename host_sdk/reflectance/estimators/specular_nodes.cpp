#include "host_sdk/reflectance/estimators/specular_nodes.h"

#include <cmath>

namespace scatter::reflectance {

std::vector<Direction> specular_nodes(const SpecularGridBrdf::Content& content, double theta_i,
                                      double phi_i) {
  std::vector<Direction> nodes;
  nodes.reserve(content.azimuth.size() * content.radial.size());
  const double cos_i = std::cos(theta_i);
  const double sin_i = std::sin(theta_i);
  for (const double azimuth : content.azimuth) {
    for (const double radial : content.radial) {
      const double x = std::sin(radial) * std::cos(azimuth);
      const double y = std::sin(radial) * std::sin(azimuth);
      const double z = std::cos(radial);
      const Direction w{x * cos_i - z * sin_i, y, x * sin_i + z * cos_i};
      const double side = content.type == ScatterType::kBrdf ? 1 : -1;
      nodes.push_back({w.x * std::cos(phi_i) - w.y * std::sin(phi_i),
                       w.x * std::sin(phi_i) + w.y * std::cos(phi_i), side * w.z});
    }
  }
  return nodes;
}

}  // namespace scatter::reflectance
