// Any text as a model spec. Promises: refusals say what and how to mend it; what is accepted scatters
// finite, non-negative light, the same in batches, reciprocally unless it is Phong's, and draws unit
// vectors with finite densities.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <string_view>

#include "host_sdk/reflectance/models/model_spec.h"
#include "tests/fuzz/require.h"

using scatter::fuzz::require;

namespace {

using namespace scatter::reflectance;

bool is_light(double value) {
  return std::isfinite(value) && value >= 0;
}

void check_eval(const Brdf& model, bool reciprocal, const Direction& i,
                std::span<const Direction> directions) {
  std::array<double, 3 * 6> batch{};
  model.eval_batch(i, directions, std::span(batch).first(3 * directions.size()), {});
  for (std::size_t k = 0; k < directions.size(); ++k) {
    std::array<double, 3> f{};
    std::array<double, 3> reversed{};
    const Origin origin = model.eval(i, directions[k], f);
    require(model.eval(directions[k], i, reversed) == origin || model.type() == ScatterType::kBtdf);
    for (std::size_t c = 0; c < 3; ++c) {
      require(is_light(f[c]));
      require(origin != Origin::kInvalid || f[c] == 0);
      require(std::abs(f[c] - batch[3 * k + c]) <= 1e-9 * f[c] + 1e-12);
      require(!reciprocal || std::abs(f[c] - reversed[c]) <= 1e-6 * std::max(f[c], 1e-9));
    }
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view spec(reinterpret_cast<const char*>(data), size);
  const auto made = make_sampled_model(spec);
  require(made.has_value() == make_model(spec).has_value());
  if (!made) {
    require(!made.error().what.empty() && !made.error().remedy.empty());
    return 0;
  }
  require(is_model_spec(spec));
  const SampledBrdf& model = **made;
  require(model.channels() == 3 && model.wavelengths_nm().size() == 3);
  const bool below = model.type() == ScatterType::kBtdf;
  const bool reciprocal = !below && spec.find("phong") == std::string_view::npos;
  for (const double theta_i : {0.0, 0.35, 1.05, 1.57}) {
    const Direction i = from_spherical(theta_i, 0.3);
    const auto at = [&](double theta, double phi) {
      return from_spherical(below ? kPi - theta : theta, phi);
    };
    const std::array directions{at(0, 0),     at(theta_i, 0.3 + kPi), at(1.3, 1.0),
                                at(0.5, 0.3), at(1.5707, 3.2),        at(kPi - 0.7, 2.0)};
    check_eval(model, reciprocal, i, directions);
    for (const Direction& o : directions) {
      require(is_light(model.pdf(i, o)));
    }
    for (const double u : {0.0, 0.37, 0.999999999}) {
      std::array<double, 3> throughput{};
      const DrawnDirection d = model.sample(i, {u, 0.61, 1 - 0.9 * u}, throughput);
      require(std::abs(dot(d.omega_o, d.omega_o) - 1) < 1e-9);
      require(is_light(d.density) && std::ranges::all_of(throughput, is_light));
    }
  }
  return 0;
}
