#include "host_sdk/reflectance/albedo.h"

#include <array>
#include <catch2/catch.hpp>
#include <cmath>

#include "host_sdk/reflectance/models/model_spec.h"
#include "host_sdk/reflectance/sampled_grid.h"

using namespace scatter::reflectance;

namespace {

/// f = (n + 2) / (2 pi) cos^n of the angle to the mirror direction; at normal incidence its
/// albedo is 1 exactly.
class CosineLobe final : public Brdf {
 public:
  explicit CosineLobe(double n) : n_(n) {}
  [[nodiscard]] ScatterType type() const noexcept override { return ScatterType::kBrdf; }
  [[nodiscard]] std::size_t channels() const noexcept override { return 1; }
  [[nodiscard]] std::span<const float> wavelengths_nm() const noexcept override { return {}; }
  [[nodiscard]] Origin eval(const Direction& i, const Direction& o,
                            std::span<double> f) const noexcept override {
    f[0] = (n_ + 2) / (2 * kPi) * std::pow(std::max(0.0, dot(mirrored(i), o)), n_);
    return Origin::kMeasured;
  }

 private:
  double n_;
};

}  // namespace

TEST_CASE("Albedo of Lambert is its albedo") {
  const auto model = make_model("lambertian:0.5/0.25/1").value();
  for (const double theta : {0.0, 20.0, 80.0}) {
    const Albedo a = albedo(*model, from_spherical(radians(theta), 1));
    REQUIRE(a.converged);
    REQUIRE(a.value[0] == Approx(0.5).margin(1e-5));
    REQUIRE(a.value[1] == Approx(0.25).margin(1e-5));
    REQUIRE(a.value[2] == Approx(1.0).margin(1e-5));
  }
}

TEST_CASE("Albedo of a cosine lobe at normal incidence is 1, however narrow") {
  for (const double n : {1.0, 50.0, 1e4, 1e6}) {
    const Albedo a = albedo(CosineLobe(n), {0, 0, 1});
    REQUIRE(a.converged);
    REQUIRE(a.value[0] == Approx(1.0).margin(2e-5));
  }
}

TEST_CASE("GGX reflects no more than came in, and a mirror-like one close to its f0") {
  for (const char* alpha : {"0.001", "0.05", "0.3", "1"}) {
    const auto model = make_model(std::string("ggx:f0=1,alpha=") + alpha).value();
    for (const double theta : {0.0, 20.0, 60.0, 85.0}) {
      const Albedo a = albedo(*model, from_spherical(radians(theta), 2));
      REQUIRE(a.value[0] <= 1 + a.error);
      REQUIRE(a.value[0] > 0.2);
      if (std::string(alpha) == "0.001" && theta < 60) {
        // Slopes beyond theta_h = 45 deg, which masking removes, hold alpha^2 = 1e-6 of the energy.
        REQUIRE(a.value[0] == Approx(1).margin(1e-4));
      }
    }
  }
}

TEST_CASE("Albedo of a film is its haze part, with the straight part named apart") {
  const Albedo a = albedo(*make_model("film:transmittance=0.6,haze=0.3").value(), {0, 0, 1});
  REQUIRE(a.value[0] == Approx(0.18).margin(1e-5));
  REQUIRE(a.dirac[0] == Approx(0.42));
}

TEST_CASE("The error estimate of the albedo holds") {
  const auto model = make_model("ggx:alpha=0.2,f0=0.5").value();
  const Direction i = from_spherical(radians(50), 0);
  const double exact = albedo(*model, i, {.tolerance = 1e-9}).value[0];
  for (const double tolerance : {1e-2, 1e-3, 1e-4, 1e-5}) {
    const Albedo a = albedo(*model, i, {.tolerance = tolerance});
    REQUIRE(std::abs(a.value[0] - exact) <= std::max(a.error, 1e-9));
    REQUIRE(a.error <= tolerance);
  }
  REQUIRE_FALSE(albedo(*model, i, {.tolerance = 1e-12, .max_evaluations = 10'000}).converged);
}

TEST_CASE("The albedo of a grid, with all its kinks, is that of the function its cells make") {
  // A ring at one row: a hat of 1 deg to either side. Integral of hat(t) sin t cos t dt = the hat's
  // transform of sin(2t)/2: sin(2 t0) / 2 * (sin(s) / s)^2 * s for steps s; times 2 pi.
  const double s = radians(1);
  for (const std::size_t row : {7, 34, 61}) {
    GridBrdf::Content content = sample_on_grid(*make_model("lambertian:0.5").value(), {}).value().content();
    for (GridPart& part : content.parts) {
      for (auto& plane : part.f_per_sr) {
        for (std::size_t n = 0; n < plane.size(); ++n) {
          plane[n] = n / 360 == row ? 1.0F : 0.0F;
        }
      }
    }
    const GridBrdf grid = GridBrdf::make(content).value();
    const double t0 = radians(static_cast<double>(row));
    const double exact = 2 * kPi * std::sin(2 * t0) / 2 * std::pow(std::sin(s) / s, 2) * s;
    for (const double theta_i : {0.0, 20.0, 60.0}) {
      for (const double tolerance : {1e-3, 1e-4}) {
        const Albedo a = albedo(grid, from_spherical(radians(theta_i), 1), {.tolerance = tolerance});
        CAPTURE(row, theta_i, tolerance, a.error);
        REQUIRE(a.converged);
        REQUIRE(std::abs(a.value[0] - exact) <= a.error);
      }
    }
  }
}

TEST_CASE("Grid albedo counts measured nodes only, or all valid ones") {
  GridBrdf::Content content = sample_on_grid(*make_model("lambertian:0.5").value(), {}).value().content();
  for (std::size_t n = 0; n < content.parts[0].origin.size(); ++n) {
    if (n / 360 > 75) {
      content.parts[0].origin[n] = Origin::kExtrapolated;
    }
  }
  const GridBrdf grid = GridBrdf::make(content).value();
  // Integral to 75.5 deg, where the last measured cell ends; midpoint cells: 2e-4 relative.
  const double s = std::sin(radians(75.5));
  REQUIRE(grid_albedo(grid, 0, Region::kMeasured)[0] == Approx(0.5 * s * s).epsilon(2e-4));
  REQUIRE(grid_albedo(grid, 0, Region::kAll)[0] == Approx(0.5).epsilon(2e-4));
}
