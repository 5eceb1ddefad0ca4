#include "host_sdk/reflectance/fitting/fit_samples.h"

#include <catch2/catch.hpp>
#include <memory>

#include "host_sdk/reflectance/sampled_grid.h"
#include "host_sdk/reflectance/specular_grid_brdf.h"
#include "tests/unit/reflectance_fitting/made_samples.h"

namespace scatter::reflectance {
namespace {

double flux(const FitSamples& samples, std::size_t incidence) {
  double sum = 0;
  const auto& of = samples.incidences[incidence];
  for (std::size_t k = of.first; k < of.first + of.count; ++k) {
    sum += samples.f_per_sr[k * samples.channels] * samples.omega_o[k].z * samples.solid_angle_sr[k];
  }
  return sum;
}

}  // namespace

TEST_CASE("A grid's usable nodes are gathered with the solid angle they stand for", "[fit_samples]") {
  GridBrdf::Content content = sample_on_grid(**make_model("lambertian:0.5"), {.theta_count = 76})->content();
  for (auto& part : content.parts) {
    part.origin.assign(part.origin.size(), Origin::kMeasured);
  }
  content.parts[1].origin[5000] = Origin::kInvalid;
  content.parts[1].origin[5001] = Origin::kInterpolated;
  // One channel at 0 is dark; all of them are a gap that the file filled.
  content.parts[2].f_per_sr[1][6000] = 0;
  for (auto& plane : content.parts[2].f_per_sr) {
    plane[6001] = 0;
  }
  const GridBrdf grid = GridBrdf::make(content).value();
  const FitSamples all = gather(grid, {.max_samples = 0}).value();
  REQUIRE(check(all));
  CHECK(all.incidences.size() == 4);
  CHECK(all.size() == 4 * 76 * 360 - 3);
  CHECK(gather(grid, {.region = Region::kAll, .max_samples = 0})->size() == 4 * 76 * 360 - 2);
  // Lambert: a sin^2 of the last cell's border.
  const double border = radians(75);
  CHECK(flux(all, 0) == Approx(0.5 * std::sin(border) * std::sin(border)).epsilon(0.02));
}

TEST_CASE("Thinning keeps the flux and the hemisphere, and looks closer where the light goes",
          "[fit_samples]") {
  const FitSamples all = test::samples_of("ggx:alpha=0.05,f0=0.8,albedo=0.1", 20'000);
  const FitSamples some = thinned(all, 4000);
  REQUIRE(check(some));
  CHECK(some.size() == Approx(4000).margin(5));
  for (std::size_t incidence = 0; incidence < 4; ++incidence) {
    CHECK(flux(some, incidence) == Approx(flux(all, incidence)).epsilon(0.03));
    // 1000 of 5000 per incidence, drawn by chance and weighted back: 1/sqrt(1000) of the spread.
    double solid_angle = 0;
    std::size_t near = 0;
    const Direction mirror = mirrored(from_spherical(some.incidences[incidence].theta_i, 0.3));
    for (std::size_t k = some.incidences[incidence].first;
         k < some.incidences[incidence].first + some.incidences[incidence].count; ++k) {
      solid_angle += some.solid_angle_sr[k];
      near += angle_between(some.omega_o[k], mirror) < radians(6) ? 1 : 0;
    }
    CHECK(solid_angle == Approx(2 * kPi * (1 - std::cos(radians(75)))).epsilon(0.03));
    // 6 deg about the mirror direction are 0.7 % of the samples; most of the light is there.
    CHECK(static_cast<double>(near) > 0.05 * static_cast<double>(some.incidences[incidence].count));
  }
}

TEST_CASE("A grid about the specular direction gives the samples of its nodes", "[fit_samples]") {
  const auto truth = make_model("ggx:alpha=0.3,f0=0.2,albedo=0.2").value();
  SpecularGridBrdf::Content content;
  content.plane_symmetric = true;
  content.rotation = {0};
  content.theta_i = {radians(15), radians(45)};
  for (int k = 0; k <= 18; ++k) {
    content.azimuth.push_back(radians(10 * k));
  }
  for (int k = 0; k <= 40; ++k) {
    content.radial.push_back(radians(2.0 * k));
  }
  content.f_per_sr.resize(3);
  for (const double a : content.theta_i) {
    for (const double p : content.azimuth) {
      for (const double r : content.radial) {
        // formats.md 1: offset about the mirror direction, light at (sin a, 0, cos a).
        const double x = std::sin(r) * std::cos(p);
        const double y = std::sin(r) * std::sin(p);
        const double z = std::cos(r);
        const Direction omega_o{x * std::cos(a) - z * std::sin(a), y, x * std::sin(a) + z * std::cos(a)};
        std::array<double, 3> f{};
        (void)truth->eval(from_spherical(a, 0), omega_o, f);
        for (std::size_t c = 0; c < 3; ++c) {
          content.f_per_sr[c].push_back(static_cast<float>(f[c]));
        }
      }
    }
  }
  const auto grid = SpecularGridBrdf::make(content).value();
  const FitSamples samples = gather(grid, {.max_samples = 0}).value();
  REQUIRE(check(samples));
  REQUIRE(samples.incidences.size() == 2);
  for (std::size_t i = 0; i < 2; ++i) {
    double solid_angle = 0;
    for (std::size_t k = samples.incidences[i].first;
         k < samples.incidences[i].first + samples.incidences[i].count; ++k) {
      std::array<double, 3> f{};
      (void)truth->eval(from_spherical(samples.incidences[i].theta_i, 0), samples.omega_o[k], f);
      REQUIRE(samples.f_per_sr[k * 3] == Approx(f[0]).epsilon(1e-6));
      solid_angle += samples.solid_angle_sr[k];
    }
    if (i == 0) {  // 80 deg about 15 deg: cut only beyond the 85 deg of GatherOptions
      CHECK(solid_angle == Approx(2 * kPi * (1 - std::cos(radians(80)))).epsilon(0.06));
    }
  }
}

TEST_CASE("Loose samples are grouped by their incidence", "[fit_samples]") {
  ScatteredSamples loose;
  loose.channels = 1;
  for (int k = 0; k < 40; ++k) {
    loose.omega_i.push_back(from_spherical(k % 2 == 0 ? 0.2 : 0.7, 0.5));
    loose.omega_o.push_back(from_spherical(0.02 * k, 1.0));
    loose.f_per_sr.push_back(0.1F);
    loose.origin.push_back(k == 3 ? Origin::kInvalid : Origin::kMeasured);
  }
  const FitSamples samples = gather(loose).value();
  REQUIRE(check(samples));
  REQUIRE(samples.incidences.size() == 2);
  CHECK(samples.incidences[0].count + samples.incidences[1].count == 39);
  CHECK(samples.incidences[0].theta_i + samples.incidences[1].theta_i == Approx(0.9));
}

TEST_CASE("What cannot be gathered is refused", "[fit_samples]") {
  CHECK(gather(**make_model("film:transmittance=0.5,haze=0.3")).error().code == ErrorCode::kInvalidArgument);
  GridBrdf::Content content = sample_on_grid(**make_model("lambertian:0.5"), {.theta_count = 76})->content();
  for (auto& part : content.parts) {
    part.origin.assign(part.origin.size(), Origin::kInvalid);
  }
  const GridBrdf grid = GridBrdf::make(content).value();
  CHECK(gather(grid).error().code == ErrorCode::kFailedPrecondition);
}

}  // namespace scatter::reflectance
