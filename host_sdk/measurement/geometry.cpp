#include "host_sdk/measurement/geometry.h"

#include "host_sdk/reflectance/direction.h"

namespace scatter::measurement {

bool is_transmission(const protocol::Illumination& illumination) noexcept {
  return static_cast<double>(illumination.theta_rad) > reflectance::kPi / 2;
}

std::vector<std::uint8_t> illuminations_of(const protocol::Descriptor& descriptor, Geometry geometry) {
  std::vector<std::uint8_t> out;
  std::uint8_t index = 0;
  for (const protocol::Illumination& illumination : descriptor.illuminations) {
    if (is_transmission(illumination) == (geometry == Geometry::kTransmission)) {
      out.push_back(index);
    }
    ++index;
  }
  return out;
}

}  // namespace scatter::measurement
