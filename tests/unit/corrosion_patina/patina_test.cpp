// A piece of copper through the years.
#include "simulator/corrosion/patina/patina.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <stop_token>

namespace scatter::corrosion {
namespace {

PatinaOptions small(Atmosphere atmosphere = Atmosphere::kUrban, double age = 100) {
  return {.atmosphere = atmosphere, .age_years = age, .side = 96, .extent_mm = 4.8, .seed = 7, .patch_mm = 1};
}

std::shared_ptr<const Patina> grown(const PatinaOptions& options) {
  const auto patina = Patina::grow(options);
  REQUIRE(patina);
  return *patina;
}

std::vector<float> thickness_of(const PatinaPiece& piece, std::size_t layer) {
  return piece.layers.layers()[layer].thickness_um;
}

TEST_CASE("At age 0 copper is bare") {
  const PatinaPiece piece = *grown(small())->at(0);
  CHECK(piece.mean_tarnish_um == 0);
  CHECK(piece.mean_patina_um == 0);
  CHECK(piece.coverage.bare == 1);
  CHECK(piece.copper_loss_um == 0);
  const Appearance look = grown(small())->appearance(piece);
  CHECK(std::ranges::all_of(look.regime, [](Regime regime) { return regime == Regime::kMetal; }));
}

TEST_CASE("Mean thicknesses are the law's, whatever the deposition") {
  for (const Deposition deposition :
       {Deposition::kSteady, Deposition::kRandom, Deposition::kRelaxed, Deposition::kBallistic}) {
    for (const Atmosphere atmosphere : kAtmospheres) {
      PatinaOptions options = small(atmosphere, 40);
      options.deposition = deposition;
      const auto patina = grown(options);
      for (const double age : {0.3, 3.0, 40.0}) {
        const PatinaPiece piece = *patina->at(age);
        const Layers expected = patina->expected(age);
        INFO(name(deposition) << ", " << name(atmosphere) << ", " << age << " years");
        CHECK(piece.mean_tarnish_um == Approx(expected.tarnish_um).epsilon(1e-5));
        // A ballistic particle overshoots by less than the relief.
        CHECK(piece.mean_patina_um == Approx(expected.patina_um).epsilon(1e-4).margin(0.01));
      }
    }
  }
}

TEST_CASE("With one rate everywhere the mean is the copper's balance, to the calendar's steps") {
  PatinaOptions options = small();
  options.patch_sigma = 0;
  const auto patina = grown(options);
  const LossBalance balance = balance_of(options.atmosphere);
  for (const double age : {2.0, 10.0, 20.0, 60.0, 100.0}) {
    const auto loss = static_cast<float>(copper_loss_um(options.atmosphere, age));
    const auto rain = static_cast<float>(data_of(options.atmosphere).runoff_um_per_year * age);
    // Thickness bends within a step of an eighth of the age; a chord is off by up to a 64th of what the bend
    // does.
    CHECK(patina->expected(age).patina_um == Approx(balance.patina_um(loss, rain)).epsilon(0.02));
    CHECK(patina->expected(age).tarnish_um == Approx(balance.tarnish_um(loss)).epsilon(1e-5));
    CHECK(patina->at(age)->copper_loss_um == Approx(loss));
  }
}

TEST_CASE("Ages are nested: no layer is thinner anywhere at a later age") {
  for (const Deposition deposition :
       {Deposition::kSteady, Deposition::kRandom, Deposition::kRelaxed, Deposition::kBallistic}) {
    PatinaOptions options = small(Atmosphere::kMarine, 60);
    options.deposition = deposition;
    std::vector<float> tarnish(96 * 96, 0.0F);
    std::vector<float> green(96 * 96, 0.0F);
    REQUIRE(grown(options)->each(std::vector<double>{0, 0.1, 0.3, 1, 2, 5, 5, 11, 30, 60},
                                 [&](const PatinaPiece& piece) {
                                   const std::vector<float> t = thickness_of(piece, 0);
                                   const std::vector<float> g = thickness_of(piece, 1);
                                   for (std::size_t i = 0; i < t.size(); ++i) {
                                     REQUIRE(t[i] >= tarnish[i]);
                                     REQUIRE(g[i] >= green[i]);
                                   }
                                   tarnish = t;
                                   green = g;
                                 }));
    CHECK(*std::ranges::max_element(green) > 0);
  }
}

TEST_CASE("An age is the same piece alone, in a series, and in a longer history of the same options") {
  const auto patina = grown(small());
  std::vector<float> in_series;
  REQUIRE(patina->each(std::vector<double>{1, 7.3, 50}, [&](const PatinaPiece& piece) {
    if (piece.age_years == 7.3) {
      in_series = thickness_of(piece, 1);
    }
  }));
  CHECK(thickness_of(*patina->at(7.3), 1) == in_series);
  CHECK(thickness_of(*grown(small(Atmosphere::kUrban, 60))->at(7.3), 1) == in_series);
}

TEST_CASE("The same seed grows the same piece, another seed another") {
  PatinaOptions other = small();
  other.seed = 8;
  CHECK(thickness_of(*grown(small())->at(9), 1) == thickness_of(*grown(small())->at(9), 1));
  CHECK(thickness_of(*grown(small())->at(9), 1) != thickness_of(*grown(other)->at(9), 1));
}

TEST_CASE("Brown first, then green: bare copper goes, tarnish comes and goes, patina takes over") {
  const auto urban = grown(small());
  CHECK(urban->at(1)->coverage.tarnish > 0.8);
  CHECK(urban->at(20)->coverage.patina > 0.8);
  CHECK(grown(small(Atmosphere::kRural))->at(20)->coverage.tarnish > 0.6);
  double bare = 1.1;
  double green = -0.1;
  REQUIRE(urban->each(std::vector<double>{0, 0.1, 0.5, 2, 5, 10, 30}, [&](const PatinaPiece& piece) {
    CHECK(piece.coverage.bare <= bare);
    CHECK(piece.coverage.patina >= green);
    bare = piece.coverage.bare;
    green = piece.coverage.patina;
    CHECK(piece.coverage.bare + piece.coverage.tarnish + piece.coverage.patina == Approx(1));
  }));
}

TEST_CASE("Growth follows the exposure map, and is nought where that is nought") {
  PatinaOptions options = small(Atmosphere::kUrban, 20);
  options.patch_sigma = 0;
  options.deposition = Deposition::kRandom;
  options.exposure = {2, 1, {0.0F, 1.0F}};  // Bilinear: 0 only in the middle of the left half.
  std::vector<float> left_shut(96 * 96, 1.0F);
  for (std::size_t i = 0; i < left_shut.size(); ++i) {
    left_shut[i] = i % 96 < 48 ? 0.0F : 1.0F;
  }
  options.exposure = {96, 96, left_shut};
  const PatinaPiece piece = *grown(options)->at(20);
  const std::vector<float> tarnish = thickness_of(piece, 0);
  const std::vector<float> green = thickness_of(piece, 1);
  double open = 0;
  for (std::size_t i = 0; i < green.size(); ++i) {
    if (i % 96 < 48) {
      REQUIRE(green[i] == 0);
      REQUIRE(tarnish[i] == 0);
    } else {
      open += green[i] / (48 * 96);
    }
  }
  PatinaOptions everywhere = options;
  everywhere.exposure = {1, 1, {1.0F}};
  CHECK(open == Approx(grown(everywhere)->expected(20).patina_um).epsilon(1e-3));
}

TEST_CASE("Random deposition spreads as Poisson's law about the local rate") {
  PatinaOptions options = small(Atmosphere::kUrban, 20);
  options.patch_sigma = 0;
  options.deposition = Deposition::kRandom;
  const std::vector<float> green =
      thickness_of(*grown(options)->at(20), 1);  // Particles of 1 um on 0.05 mm cells.
  double sum = 0;
  double sum2 = 0;
  for (const float um : green) {
    sum += um;
    sum2 += static_cast<double>(um) * um;
  }
  const auto n = static_cast<double>(green.size());
  CHECK(sum2 / n - sum / n * (sum / n) == Approx(sum / n).epsilon(0.06));
}

TEST_CASE("Upright and hanging surfaces lose less than those that face the sky") {
  const auto loss = [](float inclination_deg) {
    PatinaOptions options = small(Atmosphere::kUrban, 10);
    options.inclination_deg = {1, 1, {inclination_deg}};
    return grown(options)->at(10)->copper_loss_um;
  };
  CHECK(loss(90) == Approx(loss(0) / 2).epsilon(1e-5));
  CHECK(loss(180) == Approx(0).margin(1e-6));
}

TEST_CASE("Grids of other sizes grow like pieces: means and coverage agree") {
  PatinaOptions fine = small(Atmosphere::kUrban, 8);
  fine.side = 192;
  const PatinaPiece a = *grown(small(Atmosphere::kUrban, 8))->at(8);
  const PatinaPiece b = *grown(fine)->at(8);
  CHECK(a.mean_patina_um == Approx(b.mean_patina_um).epsilon(0.02));
  CHECK(a.coverage.patina == Approx(b.coverage.patina).margin(0.05));
}

TEST_CASE("Ages beyond the range are clamped with a note, bad options are refused by name") {
  PatinaOptions old = small(Atmosphere::kUrban, 150);
  const auto patina = grown(old);
  REQUIRE(patina->notes().size() == 1);
  CHECK(patina->notes()[0] == "age 150 is taken as 100 years");
  CHECK(patina->at(-5)->age_years == 0);
  CHECK(patina->at(500)->age_years == 100);
  CHECK_FALSE(patina->at(NAN));
  CHECK_FALSE(patina->each(std::vector<double>{5, 4}, [](const PatinaPiece&) {}));
  const auto refused = [](auto change) {
    PatinaOptions options = small();
    change(options);
    const auto result = Patina::grow(options);
    REQUIRE_FALSE(result);
    CHECK(result.error().code == ErrorCode::kInvalidArgument);
    return result.error().what;
  };
  CHECK(refused([](PatinaOptions& o) { o.side = 4; }) == "side is 4, expected 8..8192");
  CHECK(refused([](PatinaOptions& o) { o.extent_mm = 0; }) == "extent_mm is 0, expected 0.1..10000");
  CHECK(refused([](PatinaOptions& o) { o.particle_um = 0; }).starts_with("particle_um is 0"));
  CHECK(refused([](PatinaOptions& o) { o.grain_mm = NAN; }).starts_with("grain_mm is nan"));
  CHECK(refused([](PatinaOptions& o) { o.patch_mm = -1; }).starts_with("patch_mm is -1"));
  CHECK(refused([](PatinaOptions& o) { o.patch_sigma = 3; }).starts_with("patch_sigma is 3"));
  CHECK(refused([](PatinaOptions& o) { o.metal_roughness = 0; }).starts_with("metal_roughness is 0"));
  CHECK(refused([](PatinaOptions& o) { o.age_years = INFINITY; }).starts_with("age_years is inf"));
  CHECK_THAT(refused([](PatinaOptions& o) { o.exposure = {1, 1, {-1.0F}}; }), Catch::Contains("exposure"));
  CHECK_THAT(refused([](PatinaOptions& o) { o.wetness = {2, 2, {1.0F}}; }), Catch::Contains("wetness"));
  CHECK_THAT(refused([](PatinaOptions& o) { o.inclination_deg = {1, 1, {NAN}}; }),
             Catch::Contains("inclination_deg"));
}

TEST_CASE("A stopped growth shows nothing more and says so") {
  std::stop_source source;
  int shown = 0;
  const Status status = grown(small())->each(
      std::vector<double>{1, 50, 100},
      [&](const PatinaPiece&) {
        ++shown;
        source.request_stop();
      },
      source.get_token());
  REQUIRE_FALSE(status);
  CHECK(status.error().code == ErrorCode::kAborted);
  CHECK(shown == 1);
}

}  // namespace
}  // namespace scatter::corrosion
