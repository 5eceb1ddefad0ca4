// Rough dielectric interfaces, both sides of them, and metals.
#include <fmt/format.h>

#include <array>
#include <catch2/catch.hpp>
#include <cmath>

#include "host_sdk/reflectance/albedo.h"
#include "host_sdk/reflectance/models/formulas/fresnel.h"
#include "host_sdk/reflectance/models/metals.h"
#include "host_sdk/reflectance/models/model_spec.h"

using namespace scatter::reflectance;

namespace {

double red(const Brdf& model, const Direction& i, const Direction& o) {
  std::array<double, 3> f{};
  (void)model.eval(i, o, f);
  return f[0];
}

std::shared_ptr<const Brdf> interface(const char* side, double alpha, double ior) {
  return make_model(fmt::format("ggx-{}:alpha={},ior={}", side, alpha, ior)).value();
}

Direction upside_down(const Direction& w) {
  return {w.x, w.y, -w.z};
}

}  // namespace

TEST_CASE("Transmission is reciprocal between the two sides of an interface") {
  // PROVES: Walter 2007, section 2.1 (Veach 1997, eq. 5.14): f(i, o) / n_o^2 = f(o, i) / n_i^2.
  for (const double eta : {1.5, 2.4, 0.7}) {
    const auto down = interface("transmission", 0.3, eta);
    const auto up = interface("transmission", 0.3, 1 / eta);
    std::size_t compared = 0;
    for (int a = 0; a < 12; ++a) {
      for (int b = 0; b < 12; ++b) {
        const Direction i = from_spherical(0.12 * a, 0.3);
        const Direction o = from_spherical(kPi - 0.12 * b, 0.3 + kPi + 0.1 * b);
        const double f = red(*down, i, o);
        CHECK(f / (eta * eta) ==
              Approx(red(*up, upside_down(o), upside_down(i))).epsilon(1e-9).margin(1e-13));
        compared += f > 1e-6 ? 1 : 0;
      }
    }
    CHECK(compared > 50);
  }
}

TEST_CASE("A rough interface reflects and transmits together at most everything, a smooth one nearly all") {
  for (const double eta : {1.5, 2.4, 0.7}) {
    for (const double alpha : {0.05, 0.3, 0.8}) {
      const auto reflection = interface("dielectric", alpha, eta);
      const auto transmission = interface("transmission", alpha, eta);
      for (const double theta_deg : {0.0, 30.0, 60.0, 80.0}) {
        CAPTURE(eta, alpha, theta_deg);
        const Direction i = from_spherical(radians(theta_deg), 0.2);
        const double r = albedo(*reflection, i, {.tolerance = 1e-4}).value[0];
        const double t = albedo(*transmission, i, {.tolerance = 1e-4}).value[0];
        CHECK(r + t <= 1 + 2e-4);
        if (alpha < 0.1 && theta_deg < 61) {
          CHECK(r + t > 0.99);
        }
        if (alpha < 0.1 && theta_deg < (eta > 1 ? 31 : 1)) {
          // The facets spread cos_d a little, where Fresnel's term is still flat.
          CHECK(r == Approx(formulas::dielectric_fresnel(eta, i.z)).epsilon(0.02));
        }
      }
    }
  }
}

TEST_CASE("A nearly smooth interface refracts as Snell says") {
  const auto model = make_sampled_model("ggx-transmission:alpha=0.001,ior=1.5").value();
  const Direction i = from_spherical(radians(50), 0.4);
  std::array<double, 3> throughput{};
  const DrawnDirection drawn = model->sample(i, {0.3, 0.4, 0.5}, throughput);
  const Direction snell = from_spherical(kPi - std::asin(std::sin(radians(50)) / 1.5), 0.4 + kPi);
  CHECK(angle_between(drawn.omega_o, snell) < 0.005);
  CHECK(throughput[0] == Approx(1 - formulas::dielectric_fresnel(1.5, i.z)).epsilon(0.01));
  // The density of radiance grows by eta^2 into the denser side: f |cos| d omega conserves power.
  CHECK(model->pdf(i, snell) > 1e3);
}

TEST_CASE("Nothing is transmitted beyond the critical angle by smooth facets") {
  // GGX has long tails: a few facets stay below the critical angle of 41.8 deg.
  CHECK(albedo(*interface("transmission", 0.001, 1 / 1.5), from_spherical(radians(60), 0)).value[0] < 1e-5);
  CHECK(albedo(*interface("transmission", 0.02, 1 / 1.5), from_spherical(radians(30), 0), {.tolerance = 1e-4})
            .value[0] > 0.9);
}

TEST_CASE("Metals have their published constants, their colours, and cover the visible range") {
  // Rows of the papers' tables.
  const auto copper = metal_index("copper", 548.6).value();
  CHECK(copper.n == Approx(1.02).epsilon(1e-14));
  CHECK(copper.k == Approx(2.577).epsilon(1e-14));
  const auto aluminium = metal_index("aluminium", 516.6).value();
  CHECK(aluminium.n == Approx(0.8734).epsilon(1e-14));
  CHECK(aluminium.k == Approx(6.2418).epsilon(1e-14));
  // Half-way between rows.
  CHECK(metal_index("iron", (521.0 + 549.0) / 2).value().n == Approx((2.86 + 2.95) / 2).epsilon(1e-14));
  const auto reflectance = [](std::string_view metal, double wavelength_nm) {
    const ComplexIndex index = metal_index(metal, wavelength_nm).value();
    return formulas::conductor_fresnel(index.n, index.k, 1.0);
  };
  for (const std::string_view red_metal : {"copper", "gold", "brass"}) {
    CHECK(reflectance(red_metal, 630) > reflectance(red_metal, 525));
    CHECK(reflectance(red_metal, 525) > reflectance(red_metal, 465));
  }
  CHECK(reflectance("silver", 465) > 0.95);
  CHECK(reflectance("aluminium", 525) == Approx(0.917).margin(0.005));
  for (const Metal& metal : metals()) {
    CAPTURE(metal.name);
    CHECK(metal.samples.front().wavelength_nm <= 400);
    CHECK(metal.samples.back().wavelength_nm >= 700);
    for (std::size_t k = 1; k < metal.samples.size(); ++k) {
      CHECK(metal.samples[k].wavelength_nm > metal.samples[k - 1].wavelength_nm);
      CHECK(metal.samples[k].n > 0);
      CHECK(metal.samples[k].k > 0);
    }
    CHECK(metal_index(metal.name, 300).error().code == scatter::ErrorCode::kOutOfRange);
    CHECK(metal_index(metal.name, 900).error().code == scatter::ErrorCode::kOutOfRange);
    CHECK_FALSE(metal_index(metal.name, std::nan("")).has_value());
  }
  CHECK(metal_index("tin", 500).error().code == scatter::ErrorCode::kNotFound);
}
