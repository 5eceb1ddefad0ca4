// Any bytes as a BRDF file: one clear error, or a BRDF that answers with numbers.
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <string_view>
#include <vector>

#include "host_sdk/formats/open_brdf.h"
#include "host_sdk/reflectance/models/model_spec.h"

using namespace scatter::reflectance;

namespace {

void check(const Brdf& brdf) {
  std::vector<double> f(brdf.channels());
  const double side = brdf.type() == ScatterType::kBtdf ? -1 : 1;
  for (double theta = 0; theta < 1.5; theta += 0.31) {
    Direction o = from_spherical(theta, 5 * theta);
    o.z *= side;
    const Origin origin = brdf.eval(from_spherical(1.5 - theta, 2 * theta), o, f);
    for (const double value : f) {
      if (!std::isfinite(value) || (origin == Origin::kInvalid && value != 0)) {
        std::abort();
      }
    }
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view bytes(reinterpret_cast<const char*>(data), size);
  for (const auto& brdf : {scatter::formats::decode_brdf(bytes, "fuzz"), make_model(bytes)}) {
    if (brdf) {
      check(**brdf);
    } else if (brdf.error().what.empty() || brdf.error().remedy.empty()) {
      std::abort();
    }
  }
  return 0;
}
