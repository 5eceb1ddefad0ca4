// Any text as a sample spec. Promises: refusals say what and how to mend it; what is accepted has
// defects in their ranges and scatters finite, non-negative light.
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <string_view>

#include "simulator/samples/aspect.h"
#include "simulator/samples/sample.h"

namespace {

using namespace scatter;

void require(bool holds) {
  if (!holds) {
    std::abort();
  }
}

bool within(double value, double high) {
  return value >= 0 && value <= high;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view spec(reinterpret_cast<const char*>(data), size);
  if (spec.starts_with("file:")) {
    return 0;  // The readers of files have fuzz targets of their own.
  }
  const auto sample = simulator::Sample::make(spec);
  if (!sample) {
    require(!sample.error().what.empty() && !sample.error().remedy.empty());
    return 0;
  }
  const simulator::Defects& d = (*sample)->defects();
  const double ten_deg = reflectance::radians(10) + 1e-12;
  require(within(d.tilt_rad, ten_deg) && within(d.uneven_rad, ten_deg));
  require(within(d.soft, 1) && within(d.translucent, 1) && std::isfinite(d.tilt_azimuth_rad));
  const bool below = (*sample)->transmits();
  for (const double theta_i : {0.0, 0.35, 1.05}) {
    const auto source = reflectance::from_spherical(below ? reflectance::kPi - theta_i : theta_i, 0.0);
    const simulator::Aspect aspect(**sample, 3.0, source);
    require(aspect.lit());
    const std::array camera{reflectance::from_spherical(0.0, 0.0), reflectance::from_spherical(theta_i, 3.1),
                            reflectance::from_spherical(1.3, 1.0)};
    std::array<double, camera.size() * simulator::kColours> out{};
    aspect.radiance(source, camera, out);
    for (const double value : out) {
      require(std::isfinite(value) && value >= 0);
    }
  }
  return 0;
}
