// The EXR tile reader: what it accepts is a consistent grid that answers with numbers.
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <string_view>

#include "host_sdk/formats/exr_tiles.h"

using namespace scatter::reflectance;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto tiles =
      scatter::formats::decode_exr_tiles({reinterpret_cast<const char*>(data), size}, "fuzz.exr");
  if (!tiles) {
    if (tiles.error().what.empty() || tiles.error().remedy.empty()) {
      std::abort();
    }
    return 0;
  }
  if (!SpecularGridBrdf::make(tiles->content()).has_value()) {
    std::abort();
  }
  std::array<double, 3> values{};
  const std::span<double> f = std::span(values).first(tiles->channels());
  for (double theta = 0; theta < 1.5; theta += 0.23) {
    const double side = tiles->type() == ScatterType::kBtdf ? -1 : 1;
    Direction o = from_spherical(theta, 7 * theta);
    o.z *= side;
    const Origin origin = tiles->eval(from_spherical(1.5 - theta, theta), o, f);
    for (const double value : f) {
      if (!std::isfinite(value) || (origin == Origin::kInvalid && value != 0)) {
        std::abort();
      }
    }
  }
  return 0;
}
