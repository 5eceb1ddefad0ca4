// PROVES: instrument.md section 6, tilt.
#include "host_sdk/measurement/tilt_fit.h"

#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <random>

#include "host_sdk/measurement/pixel_geometry.h"
#include "host_sdk/reflectance/models/model_spec.h"

using namespace scatter;
using namespace scatter::measurement;
using reflectance::degrees;
using reflectance::Direction;
using reflectance::radians;

namespace {

/// What the four heads of an HS-1 see of a tilted sample, with `noise` relative.
std::vector<HeadSamples> heads_of(const std::string& spec, double tilt_x_deg, double tilt_y_deg,
                                  double noise) {
  const auto model = reflectance::make_model(spec);
  REQUIRE(model);
  const SampleFrame frame = sample_frame(radians(tilt_x_deg), radians(tilt_y_deg), 0);
  std::mt19937 engine(3);
  std::normal_distribution<double> normal;
  std::vector<HeadSamples> heads;
  for (const double theta : {0.0, 20.0, 40.0, 60.0}) {
    HeadSamples head;
    head.omega_i = reflectance::from_spherical(radians(theta), 0);
    for (int j = 2; j <= 75; j += 2) {
      const int step = std::max(2, static_cast<int>(std::lround(2 / std::sin(radians(j)))));
      for (int i = 0; i < 360; i += step) {
        const Direction w = reflectance::from_spherical(radians(j), radians(i));
        std::array<double, 3> f{};
        (void)(*model)->eval(frame.to_sample(head.omega_i), frame.to_sample(w), f);
        const double seen = f[1] * frame.to_sample(head.omega_i).z / head.omega_i.z;
        head.omega_o.push_back(w);
        head.sigma_per_sr.push_back(noise * seen);
        head.f_per_sr.push_back(seen * (1 + noise * normal(engine)));
      }
    }
    heads.push_back(std::move(head));
  }
  return heads;
}

}  // namespace

TEST_CASE("Tilt of a glossy sample is told to a tenth of a degree, whatever its direction") {
  for (const char* spec :
       {"ggx:alpha=0.1,f0=0.04,albedo=0.3", "ggx:alpha=0.2,f0=0.04,albedo=0.3", "ggx:alpha=0.15,f0=0.9"}) {
    for (const auto& [x, y] :
         {std::pair{0.0, 0.0}, std::pair{0.866, 0.5}, std::pair{-1.2, 0.3}, std::pair{0.1, -2.0}}) {
      const auto fit = fit_tilt(heads_of(spec, x, y, 0.003));
      REQUIRE(fit);
      CHECK(fit->tilt.told);
      CHECK(std::abs(degrees(fit->tilt.x_rad) - x) < 0.1);
      CHECK(std::abs(degrees(fit->tilt.y_rad) - y) < 0.1);
      CHECK(fit->tilt.standard_error_rad < radians(0.05));
    }
  }
}

TEST_CASE("Tilt of a Lambertian sample is never told") {
  for (const double tilt : {0.0, 1.0}) {
    const auto fit = fit_tilt(heads_of("lambertian:0.5", tilt, 0, 0.003));
    REQUIRE(fit);
    CHECK_FALSE(fit->tilt.told);
  }
}

TEST_CASE("The stated standard error covers the fit's own scatter") {
  // Four sigma of the stated error, on a material where the lobe is weak.
  const auto fit = fit_tilt(heads_of("ggx:alpha=0.3,f0=0.04,albedo=0.5", 0.5, 0.5, 0.005));
  REQUIRE(fit);
  CHECK(std::abs(fit->tilt.x_rad - radians(0.5)) < 4 * fit->tilt.standard_error_rad);
  CHECK(std::abs(fit->tilt.y_rad - radians(0.5)) < 4 * fit->tilt.standard_error_rad);
}
