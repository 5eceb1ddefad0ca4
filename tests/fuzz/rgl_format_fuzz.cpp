// The RGL reader: what it accepts is a material that answers with finite numbers of at least 0 and
// survives writing bit by bit.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string_view>
#include <vector>

#include "host_sdk/formats/rgl.h"
#include "tests/fuzz/require.h"

using scatter::fuzz::require;

using namespace scatter::reflectance;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view bytes(reinterpret_cast<const char*>(data), size);
  const auto brdf = scatter::formats::decode_rgl(bytes, "fuzz.bsdf");
  if (!brdf) {
    require(!brdf.error().what.empty() && !brdf.error().remedy.empty());
    return 0;
  }
  std::vector<double> f(brdf->channels());
  for (double theta = 0; theta < 1.5; theta += 0.23) {
    const Direction i = from_spherical(1.5 - theta, theta);
    const Direction o = from_spherical(theta, 7 * theta);
    const Origin origin = brdf->eval(i, o, f);
    for (const double value : f) {
      require(value >= 0 && (origin != Origin::kInvalid || value == 0));
    }
    require(!(brdf->pdf(i, o) < 0));
    const Direction sampled = brdf->sample(i, {theta / 1.5, 0.5});
    require(!(sampled.z > 1.001));
  }
  if (brdf->channels() != 3) {
    return 0;  // The writer sorts wavelengths.
  }
  const auto written = scatter::formats::encode_rgl(*brdf);
  require(written.has_value());
  const auto again = scatter::formats::decode_rgl(*written, "again.bsdf");
  require(again.has_value());
  require(std::ranges::equal(again->content().spectra.values, brdf->content().spectra.values));
  require(std::ranges::equal(again->vndf().values, brdf->vndf().values));
  require(again->content().phi_i == brdf->content().phi_i &&
          again->content().theta_i == brdf->content().theta_i);
  require(again->content().jacobian == brdf->content().jacobian);
  return 0;
}
