// Any text as a sample spec. Promises: refusals say what and how to mend it; what is accepted has
// defects in their ranges and scatters finite, non-negative light.
#include <array>
#include <cmath>
#include <cstdint>
#include <string>
#include <string_view>

#include "simulator/samples/aspect.h"
#include "simulator/samples/corroded_spec.h"
#include "simulator/samples/patina_spec.h"
#include "simulator/samples/sample.h"
#include "simulator/samples/spec_sheet.h"
#include "simulator/samples/textured_spec.h"
#include "tests/fuzz/require.h"

using scatter::fuzz::require;

namespace {

using namespace scatter;

bool within(double value, double high) {
  return value >= 0 && value <= high;
}

/// Sheets are not grown here, only read: what is accepted is in range and has a place that its text can be
/// given.
template <typename Spec>
void check_sheet(std::string_view spec, const Result<Spec>& read) {
  if (!read) {
    require(!read.error().what.empty() && !read.error().remedy.empty());
    return;
  }
  const auto& growth = read->growth;
  require(growth.extent_mm >= simulator::kSpotMm && within(growth.age_years, 100));
  require(static_cast<double>(growth.side) * simulator::kSpotMm + 1e-6 >=
          growth.extent_mm * simulator::kCellsPerSpot);
  require(within(read->optics.metal_alpha, 1) && within(read->optics.backing, 1));
  require(!read->place || (within(read->place->u, 1) && within(read->place->v, 1)));
  const simulator::Place place{0.25, 0.75};
  const std::string moved = simulator::spec_at(spec, place);
  const auto again = simulator::parse_corroded(moved);
  require(!moved.starts_with("corroded:") ||
          (again && again->place && again->place->u == 0.25 && again->place->v == 0.75));
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view spec(reinterpret_cast<const char*>(data), size);
  if (spec.starts_with("file:")) {
    return 0;  // The readers of files have fuzz targets of their own.
  }
  if (simulator::is_textured_spec(spec)) {
    if (spec.starts_with("patina:")) {
      check_sheet(spec, simulator::parse_patina(spec));
    } else {
      check_sheet(spec, simulator::parse_corroded(spec));
    }
    return 0;
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
