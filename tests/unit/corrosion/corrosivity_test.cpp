#include "simulator/corrosion/corrosivity.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <limits>

namespace scatter::corrosion {
namespace {

TEST_CASE("Corrosivity: cumulative losses are those of the thesis's table 2") {
  struct Row {
    Corrosivity corrosivity;
    double w[7];
  };
  // corrosion.md 1.1, at 1, 5, 10, 15, 20, 25 and 100 years.
  const Row rows[] = {{Corrosivity::kVeryLow, {5.5, 13.7, 20.2, 25.4, 29.9, 33.9, 74.2}},
                      {Corrosivity::kLow, {100.4, 204.2, 277.2, 331.4, 376.3, 415.2, 765.1}},
                      {Corrosivity::kMedium, {274.6, 630.0, 900.9, 1110.6, 1288.3, 1445.6, 2956.0}},
                      {Corrosivity::kHigh, {477.4, 1333.0, 2074.4, 2686.8, 3228.0, 3721.9, 9013.3}},
                      {Corrosivity::kVeryHigh, {954.8, 3399.4, 5873.7, 8088.1, 10149.0, 12102.8, 36133.7}}};
  const double ages[] = {1, 5, 10, 15, 20, 25, 100};
  for (const Row& row : rows) {
    for (std::size_t i = 0; i < 7; ++i) {
      CHECK(mass_loss_g_per_m2(row.corrosivity, Law::kThesis, ages[i]) == Approx(row.w[i]).margin(0.051));
    }
  }
}

TEST_CASE("Corrosivity: a fit of log w on log t gives back k and n to 0.1 %") {
  const double k[] = {5.5, 100.4, 274.6, 477.4, 954.8};
  const double n[] = {0.565, 0.441, 0.516, 0.638, 0.789};
  for (const Corrosivity corrosivity : kCorrosivities) {
    double sx = 0;
    double sy = 0;
    double sxx = 0;
    double sxy = 0;
    for (int t = 1; t <= 100; ++t) {
      const double x = std::log(t);
      const double y = std::log(mass_loss_g_per_m2(corrosivity, Law::kThesis, t));
      sx += x;
      sy += y;
      sxx += x * x;
      sxy += x * y;
    }
    const double slope = (100 * sxy - sx * sy) / (100 * sxx - sx * sx);
    CHECK(slope == Approx(n[static_cast<int>(corrosivity)]).epsilon(1e-3));
    CHECK(std::exp((sy - slope * sx) / 100) == Approx(k[static_cast<int>(corrosivity)]).epsilon(1e-3));
  }
}

TEST_CASE("Corrosivity: the ISO law's attack is that of ISO 9224 at each class's upper limit, to 0.5 um") {
  // corrosion.md 3.2: C1 to C5 at 1, 2, 5, 10, 15 and 20 years.
  const double attack_um[5][6] = {{1.3, 1.9, 3.0, 4.3, 5.4, 6.2},
                                  {25, 36, 58, 83, 103, 120},
                                  {50, 72, 116, 167, 206, 240},
                                  {80, 115, 186, 267, 330, 383},
                                  {200, 287, 464, 667, 824, 958}};
  const double ages[] = {1, 2, 5, 10, 15, 20};
  for (const Corrosivity corrosivity : kCorrosivities) {
    for (std::size_t i = 0; i < 6; ++i) {
      const double um =
          mass_loss_g_per_m2(corrosivity, Law::kIso9224, ages[i]) / kSteelGramsPerSquareMetrePerUm;
      CHECK(um == Approx(attack_um[static_cast<int>(corrosivity)][i]).margin(0.5001));
    }
  }
}

TEST_CASE("Corrosivity: after 20 years the ISO law goes straight on with the slope it had") {
  const auto w = [](double t) { return mass_loss_g_per_m2(Corrosivity::kMedium, Law::kIso9224, t); };
  // r b 20^(b - 1) with r = 50 um.
  const double slope = 50 * 7.8 * 0.523 * std::pow(20, 0.523 - 1);
  CHECK((w(21) - w(20)) == Approx(slope));
  CHECK((w(100) - w(50)) == Approx(50 * slope));
  CHECK((w(20) - w(20 - 1e-6)) / 1e-6 == Approx(slope).epsilon(1e-4));
}

TEST_CASE("Corrosivity: ages are clamped to 0 to 100 years") {
  for (const Law law : {Law::kThesis, Law::kIso9224}) {
    CHECK(mass_loss_g_per_m2(Corrosivity::kHigh, law, -5) == 0);
    CHECK(mass_loss_g_per_m2(Corrosivity::kHigh, law, 0) == 0);
    CHECK(mass_loss_g_per_m2(Corrosivity::kHigh, law, 150) ==
          mass_loss_g_per_m2(Corrosivity::kHigh, law, 100));
  }
}

TEST_CASE("Corrosivity: the age of a loss is the inverse of the loss at an age") {
  for (const Law law : {Law::kThesis, Law::kIso9224}) {
    for (const Corrosivity corrosivity : kCorrosivities) {
      for (const double age : {1e-6, 0.3, 1.0, 19.99, 20.0, 20.01, 57.0, 100.0}) {
        CHECK(age_of_loss_years(corrosivity, law, mass_loss_g_per_m2(corrosivity, law, age)) ==
              Approx(age).epsilon(1e-12));
      }
      CHECK(age_of_loss_years(corrosivity, law, 0) == 0);
      CHECK(age_of_loss_years(corrosivity, law, -1) == 0);
      CHECK(age_of_loss_years(corrosivity, law, std::numeric_limits<double>::quiet_NaN()) == 0);
      CHECK(age_of_loss_years(corrosivity, law, 1e9) == 100);
    }
  }
}

TEST_CASE("Corrosivity: classes and laws are found by name, and unknown names list the known ones") {
  for (const Corrosivity corrosivity : kCorrosivities) {
    CHECK(*corrosivity_named(name(corrosivity)) == corrosivity);
  }
  CHECK(*corrosivity_named("Very_High") == Corrosivity::kVeryHigh);
  CHECK(*corrosivity_named("very-low") == Corrosivity::kVeryLow);
  CHECK(*law_named("thesis") == Law::kThesis);
  CHECK(*law_named("ISO9224") == Law::kIso9224);
  const auto wrong = corrosivity_named("severe");
  REQUIRE(!wrong);
  CHECK(wrong.error().code == ErrorCode::kInvalidArgument);
  CHECK(wrong.error().what == "corrosivity: 'severe' is no class");
  CHECK(wrong.error().remedy == "use very low, low, medium, high or very high");
  CHECK(law_named("").error().remedy == "use thesis or iso9224");
}

}  // namespace
}  // namespace scatter::corrosion
