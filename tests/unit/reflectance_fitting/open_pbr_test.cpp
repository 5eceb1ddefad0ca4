#include "host_sdk/reflectance/fitting/open_pbr.h"

#include <array>
#include <catch2/catch.hpp>

#include "host_sdk/reflectance/fitting/fit.h"
#include "tests/unit/reflectance_fitting/made_samples.h"

namespace scatter::reflectance {
namespace {

/// Integral of f cos_i over the incident directions at one outgoing direction.
double seen_from(const OpenPbr& brdf, double theta_o) {
  constexpr int kThetas = 400;
  constexpr int kPhis = 200;
  const Direction omega_o = from_spherical(theta_o, 0);
  double sum = 0;
  for (int a = 0; a < kThetas; ++a) {
    const double theta = (a + 0.5) / kThetas * kPi / 2;
    for (int b = 0; b < kPhis; ++b) {
      std::array<double, 1> f{};
      (void)brdf.eval(from_spherical(theta, 2 * kPi * (b + 0.5) / kPhis), omega_o, f);
      sum += f[0] * std::cos(theta) * std::sin(theta) * (kPi / 2 / kThetas) * (2 * kPi / kPhis);
    }
  }
  return sum;
}

}  // namespace

TEST_CASE("A white OpenPBR dielectric sends back all light: what the gloss takes, the base lacks",
          "[open_pbr]") {
  // Albedo scaling: E + (1 - E) * 1 = 1, seen from omega_o, whatever the roughness and the index.
  for (const double roughness : {0.4, 0.7, 1.0}) {
    for (const double ior : {1.0, 1.5, 2.0}) {
      const OpenPbr brdf({.base_color = {1}, .metalness = 0, .roughness = roughness, .ior = ior});
      for (const double theta_o_deg : {0.0, 40.0, 70.0}) {
        CAPTURE(roughness, ior, theta_o_deg);
        // The table has 33 nodes, E is linear between them.
        CHECK(seen_from(brdf, radians(theta_o_deg)) == Approx(1).epsilon(0.01));
      }
    }
  }
}

TEST_CASE("An OpenPBR metal is the GGX lobe with Schlick's Fresnel term", "[open_pbr]") {
  const OpenPbr brdf({.base_color = {0.9, 0.6, 0.3}, .metalness = 1, .roughness = 0.5, .ior = 1.5});
  const auto ggx = make_model("ggx:alpha=0.25,f0=0.9/0.6/0.3,albedo=0").value();
  for (const double theta : {0.1, 0.6, 1.2}) {
    std::array<double, 3> a{};
    std::array<double, 3> b{};
    const Direction omega_i = from_spherical(theta, 0.4);
    const Direction omega_o = from_spherical(0.7, 3.0 + theta);
    CHECK(brdf.eval(omega_i, omega_o, a) != Origin::kInvalid);
    (void)ggx->eval(omega_i, omega_o, b);
    for (std::size_t c = 0; c < 3; ++c) {
      CHECK(a[c] == Approx(b[c]).epsilon(1e-12));
    }
  }
}

TEST_CASE("Recolouring finds the base colour that made the samples", "[open_pbr]") {
  const OpenPbr truth({.base_color = {0.8, 0.3, 0.05}, .metalness = 0.2, .roughness = 0.6, .ior = 1.6});
  FitSamples samples = test::samples_of("lambertian:0.5", 500);
  for (const auto& incidence : samples.incidences) {
    for (std::size_t k = incidence.first; k < incidence.first + incidence.count; ++k) {
      (void)truth.eval(from_spherical(incidence.theta_i, incidence.phi_i), samples.omega_o[k],
                       std::span(samples.f_per_sr).subspan(k * 3, 3));
    }
  }
  OpenPbr::Parameters grey = truth.parameters();
  grey.base_color = {0.5, 0.5, 0.5};
  const auto found = OpenPbr(grey).recoloured(samples);
  REQUIRE(found);
  CHECK(found->parameters().base_color[0] == Approx(0.8).epsilon(1e-6));
  CHECK(found->parameters().base_color[1] == Approx(0.3).epsilon(1e-6));
  CHECK(found->parameters().base_color[2] == Approx(0.05).epsilon(1e-6));
  CHECK(OpenPbr({.base_color = {0.5}}).recoloured(samples).error().code == ErrorCode::kInvalidArgument);
}

TEST_CASE("OpenPBR has no value below the horizon", "[open_pbr]") {
  const OpenPbr brdf({.base_color = {0.5}});
  std::array<double, 1> f{7};
  CHECK(brdf.eval({0, 0, 1}, {0, 0.6, -0.8}, f) == Origin::kInvalid);
  CHECK(f[0] == 0);
}

}  // namespace scatter::reflectance
