// Any text as a chain of estimators. Promises: refusals say what and how to mend it; what is accepted names
// itself by a text that makes the same chain, gives finite values, 0 where it has none, and the same
// in batches. Links that fill grids or fit models are left to the unit tests: they take long by design.
#include <array>
#include <cmath>
#include <cstdint>
#include <memory>
#include <string_view>
#include <vector>

#include "host_sdk/reflectance/estimators/chain.h"
#include "host_sdk/reflectance/estimators/scattered_brdf.h"
#include "host_sdk/reflectance/grid_brdf.h"
#include "tests/fuzz/require.h"

using scatter::fuzz::require;

namespace {

using namespace scatter::reflectance;

double value_at(double theta_i, double theta_o, double phi) {
  return 1 + theta_i + std::sin(theta_o) * std::cos(phi);
}

std::shared_ptr<const Brdf> grid() {
  GridBrdf::Content content;
  content.channels = 1;
  content.theta_count = 16;
  content.phi_count = 12;
  content.theta_step = radians(5);
  content.phi_step = radians(30);
  for (const double theta_i : {10.0, 40.0}) {
    GridPart part;
    part.theta_i = radians(theta_i);
    part.f_per_sr.emplace_back();
    for (std::size_t n = 0; n < 16 * 12; ++n) {
      part.f_per_sr[0].push_back(
          static_cast<float>(value_at(part.theta_i, static_cast<double>(n / 12) * content.theta_step,
                                      static_cast<double>(n % 12) * content.phi_step)));
      part.origin.push_back(n == 77 ? Origin::kInvalid : Origin::kMeasured);
    }
    content.parts.push_back(std::move(part));
  }
  return std::make_shared<const GridBrdf>(GridBrdf::make(std::move(content)).value());
}

std::shared_ptr<const Brdf> samples() {
  ScatteredSamples list;
  list.channels = 1;
  for (const double theta_i : {10.0, 40.0}) {
    for (const double theta_o : {0.0, 20.0, 50.0}) {
      for (double phi = 0; phi < 359; phi += 30) {
        list.omega_i.push_back(from_spherical(radians(theta_i), 0));
        list.omega_o.push_back(from_spherical(radians(theta_o), radians(phi)));
        list.f_per_sr.push_back(static_cast<float>(value_at(theta_i, theta_o, phi)));
      }
    }
  }
  return ScatteredBrdf::make(std::move(list)).value();
}

void check_chain(const Brdf& chain) {
  std::vector<Direction> exits{{0, 0, 1}, {0, 0, 0}, {0, 0, -1}, {1, 0, 0}, {std::nan(""), 0, 0}};
  for (double theta = 3; theta < 90; theta += 14) {
    exits.push_back(from_spherical(radians(theta), radians(7 * theta)));
  }
  for (const double theta_i : {0.0, 10.0, 23.0, 60.0, 89.9, 120.0}) {
    const Direction i = from_spherical(radians(theta_i), 0.4);
    std::vector<double> batch(exits.size());
    std::vector<Origin> origins(exits.size());
    chain.eval_batch(i, exits, batch, origins);
    for (std::size_t k = 0; k < exits.size(); ++k) {
      double f = -1;
      const Origin origin = chain.eval(i, exits[k], std::span(&f, 1));
      require(origin == origins[k]);
      require(std::isfinite(f));
      require(origin != Origin::kInvalid || f == 0);
      require(std::abs(f - batch[k]) <= 1e-5 * std::abs(f) + 1e-6);
    }
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const std::array<std::shared_ptr<const Brdf>, 2> kData{grid(), samples()};
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  if (text.find("grid") != std::string_view::npos || text.find("guided") != std::string_view::npos) {
    return 0;
  }
  for (const std::shared_ptr<const Brdf>& measured : kData) {
    const auto chain = make_chain(measured, text);
    if (!chain) {
      require(!chain.error().what.empty() && !chain.error().remedy.empty());
      continue;
    }
    const auto again = make_chain(measured, chain->text);
    require(again.has_value() && again->text == chain->text);
    check_chain(*chain->brdf);
  }
  return 0;
}
