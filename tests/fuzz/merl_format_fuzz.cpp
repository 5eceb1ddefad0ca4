// The MERL reader: what it accepts is a consistent table that survives writing but for float rounding.
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "host_sdk/formats/merl.h"
#include "tests/fuzz/require.h"

using scatter::fuzz::require;

using namespace scatter::reflectance;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view bytes(reinterpret_cast<const char*>(data), size);
  const auto brdf = scatter::formats::decode_merl(bytes, "fuzz.binary");
  if (!brdf) {
    require(!brdf.error().what.empty() && !brdf.error().remedy.empty());
    return 0;
  }
  std::array<double, 3> f{};
  for (double theta = 0; theta < 1.5; theta += 0.13) {
    const Origin origin = brdf->eval(from_spherical(1.5 - theta, theta), from_spherical(theta, 7 * theta), f);
    for (const double value : f) {
      require(std::isfinite(value) && value >= 0 && (origin != Origin::kInvalid || value == 0));
    }
  }
  const auto written = scatter::formats::encode_merl(*brdf);
  require(written.has_value() && written->size() == size);
  const auto again = scatter::formats::decode_merl(*written, "again.binary");
  require(again.has_value());
  for (std::size_t k = 0; k < brdf->content().f_per_sr.size(); ++k) {
    const float a = brdf->content().f_per_sr[k];
    const float b = again->content().f_per_sr[k];
    // Every negative number means the same.
    require((a < 0 && b < 0) || std::abs(a - b) <= 1e-6F * std::abs(a));
  }
  return 0;
}
