#include "host_sdk/reflectance/estimators/scattered_brdf.h"

#include <catch2/catch.hpp>
#include <limits>
#include <map>

#include "tests/unit/reflectance_estimators/made_data.h"

using namespace scatter::reflectance;
using namespace scatter::reflectance::made;

namespace {

ScatteredSamples single(const Direction& i, const Direction& o, float f) {
  ScatteredSamples samples;
  samples.channels = 1;
  samples.omega_i = {i};
  samples.omega_o = {o};
  samples.f_per_sr = {f};
  return samples;
}

std::string refusal(const ScatteredSamples& samples) {
  const auto made = ScatteredBrdf::make(samples);
  return made ? std::string() : made.error().what;
}

double ramp(double theta_i, double theta_o, double phi) {
  return 1 + theta_i + 2 * theta_o + 0.1 * std::cos(phi);
}

}  // namespace

TEST_CASE("A sample answers at its own pair of directions and nowhere else") {
  const auto brdf = ScatteredBrdf::make(rings({20, 40}, {10, 30}, 30, ramp)).value();
  REQUIRE(brdf->size() == 48);
  REQUIRE(at(*brdf, deg(20, 0), deg(30, 60)).f == Approx(ramp(radians(20), radians(30), radians(60))));
  REQUIRE(at(*brdf, deg(20, 0), deg(30, 60)).origin == Origin::kMeasured);
  for (const Value& v : {at(*brdf, deg(20, 0), deg(30, 61)), at(*brdf, deg(21, 0), deg(30, 60)),
                         at(*brdf, deg(20, 0), deg(29.99, 60))}) {
    REQUIRE(v.origin == Origin::kInvalid);
    REQUIRE(v.f == 0);
  }
}

TEST_CASE("Light at one azimuth means an isotropic sample, light at two does not") {
  const auto one = ScatteredBrdf::make(rings({0, 40}, {30}, 30, ramp, 15)).value();
  REQUIRE(one->azimuth().value() == Approx(radians(15)));
  REQUIRE(at(*one, deg(40, 200), deg(30, 200 + 45)).f == Approx(ramp(radians(40), radians(30), radians(45))));
  ScatteredSamples both = rings({40}, {30}, 30, ramp, 0);
  const ScatteredSamples turned = rings({40}, {30}, 30, ramp, 90);
  both.omega_i.insert(both.omega_i.end(), turned.omega_i.begin(), turned.omega_i.end());
  both.omega_o.insert(both.omega_o.end(), turned.omega_o.begin(), turned.omega_o.end());
  both.f_per_sr.insert(both.f_per_sr.end(), turned.f_per_sr.begin(), turned.f_per_sr.end());
  const auto two = ScatteredBrdf::make(both).value();
  REQUIRE_FALSE(two->azimuth().has_value());
  REQUIRE(at(*two, deg(40, 90), deg(30, 30)).origin == Origin::kMeasured);
  REQUIRE(at(*two, deg(40, 200), deg(30, 245)).origin == Origin::kInvalid);
}

TEST_CASE("Samples at one place are one site with their mean and their worst origin") {
  ScatteredSamples samples = single(deg(20, 0), {0, 0, 1}, 1.0F);
  for (const float f : {2.0F, 6.0F}) {
    samples.omega_i.push_back(deg(20, 0));
    samples.omega_o.push_back({0, 0, 1});
    samples.f_per_sr.push_back(f);
  }
  samples.random_per_sr = {0.1F, 0.2F, 0.6F};
  samples.systematic_per_sr = {1.0F, 1.0F, 4.0F};
  samples.origin = {Origin::kMeasured, Origin::kInterpolated, Origin::kMeasured};
  const auto brdf = ScatteredBrdf::make(samples).value();
  REQUIRE(brdf->site_count() == 1);
  REQUIRE(at(*brdf, deg(20, 0), {0, 0, 1}).f == Approx(3));
  REQUIRE(at(*brdf, deg(20, 0), {0, 0, 1}).origin == Origin::kInterpolated);
  double random = 0;
  double systematic = 0;
  REQUIRE(brdf->uncertainty(deg(20, 0), {0, 0, 1}, std::span(&random, 1), std::span(&systematic, 1)));
  REQUIRE(random == Approx(0.3));
  REQUIRE(systematic == Approx(2));
  REQUIRE(brdf->remove(1));
  REQUIRE(at(*brdf, deg(20, 0), {0, 0, 1}).f == Approx(3.5));
  REQUIRE(at(*brdf, deg(20, 0), {0, 0, 1}).origin == Origin::kMeasured);
}

TEST_CASE("Any order of additions and removals leaves what a plain list of the same samples holds") {
  const auto brdf = ScatteredBrdf::make([] {
                      ScatteredSamples none;
                      none.channels = 1;
                      return none;
                    }())
                        .value();
  std::mt19937 random(7);
  // Few places, so that many samples share one: 6 incidences x 6 exits.
  std::map<ScatteredBrdf::SampleId, std::pair<std::pair<int, int>, float>> held;
  std::uniform_int_distribution<int> place(0, 5);
  std::uniform_real_distribution<float> value(0, 1);
  const auto incident = [](int k) { return deg(10.0 * k + 5, 0); };
  const auto exit = [](int k) { return deg(12.0 * k, 77.0 * k); };
  for (int round = 0; round < 3000; ++round) {
    if (held.empty() || random() % 5 < 3) {
      const std::pair<int, int> where{place(random), place(random)};
      const float f = value(random);
      const Direction i = incident(where.first);
      const Direction o = exit(where.second);
      const auto id = brdf->add({.omega_i = i,
                                 .omega_o = o,
                                 .f_per_sr = std::span(&f, 1),
                                 .random_per_sr = {},
                                 .systematic_per_sr = {}});
      REQUIRE(id.has_value());
      REQUIRE_FALSE(held.contains(*id));
      held[*id] = {where, f};
    } else {
      auto victim = held.begin();
      std::advance(victim, static_cast<std::ptrdiff_t>(random() % held.size()));
      REQUIRE(brdf->remove(victim->first));
      REQUIRE_FALSE(brdf->remove(victim->first));
      held.erase(victim);
    }
    const std::pair<int, int> asked{place(random), place(random)};
    double sum = 0;
    int count = 0;
    for (const auto& [id, sample] : held) {
      if (sample.first == asked) {
        sum += static_cast<double>(sample.second);
        count += 1;
      }
    }
    const Value v = at(*brdf, incident(asked.first), exit(asked.second));
    REQUIRE(v.origin == (count > 0 ? Origin::kMeasured : Origin::kInvalid));
    REQUIRE(v.f == Approx(count > 0 ? sum / count : 0.0).epsilon(1e-6));
    REQUIRE(brdf->size() == held.size());
  }
  for (const auto& [id, sample] : held) {
    REQUIRE(brdf->remove(id));
  }
  REQUIRE(brdf->site_count() == 0);
  REQUIRE(brdf->samples().size() == 0);
  REQUIRE(at(*brdf, incident(1), exit(1)).origin == Origin::kInvalid);
}

TEST_CASE("Samples come back as they were given") {
  ScatteredSamples samples = rings({20}, {0, 10}, 90, ramp);
  samples.metadata["software"] = "made";
  samples.origin.assign(samples.size(), Origin::kMeasured);
  samples.origin[3] = Origin::kInvalid;
  samples.f_per_sr[3] = std::numeric_limits<float>::quiet_NaN();
  const ScatteredSamples back = ScatteredBrdf::make(samples).value()->samples();
  REQUIRE(back.size() == samples.size());
  REQUIRE(back.metadata == samples.metadata);
  for (std::size_t s = 0; s < back.size(); ++s) {
    REQUIRE(back.omega_o[s].x == samples.omega_o[s].x);
    REQUIRE(back.origin[s] == samples.origin[s]);
    REQUIRE((s == 3 || back.f_per_sr[s] == samples.f_per_sr[s]));
  }
}

TEST_CASE("Samples that are no samples are refused with their number") {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  REQUIRE(refusal(single({0, 0, 0}, {0, 0, 1}, 1)).find("omega_i 0") != std::string::npos);
  REQUIRE(refusal(single({0, 0, -1}, {0, 0, 1}, 1)).find("z > 0") != std::string::npos);
  REQUIRE(refusal(single({0, 0, 1}, {0, 0, -1}, 1)).find("omega_o 0") != std::string::npos);
  REQUIRE(refusal(single({0, 0, 1}, {0, 0, 2}, 1)).find("unit vector") != std::string::npos);
  REQUIRE(refusal(single({0, 0, 1}, {std::nan(""), 0, 1}, 1)).find("omega_o 0") != std::string::npos);
  REQUIRE(refusal(single({0, 0, 1}, {0, 0, 1}, nan)).find("sample 0, channel 0 is nan") != std::string::npos);
  ScatteredSamples odd = single({0, 0, 1}, {0, 0, 1}, 1);
  odd.f_per_sr.push_back(2);
  REQUIRE(refusal(odd).find("2 numbers, expected 1 x 1 = 1") != std::string::npos);
  odd = single({0, 0, 1}, {0, 0, 1}, 1);
  odd.random_per_sr = {-1.0F};
  odd.systematic_per_sr = {0.0F};
  REQUIRE(refusal(odd).find("expected a finite number >= 0") != std::string::npos);
  odd.random_per_sr.clear();
  REQUIRE(refusal(odd).find("without the other") != std::string::npos);
  odd = single({0, 0, 1}, {0, 0, 1}, 1);
  odd.channels = 0;
  REQUIRE(refusal(odd).find("0 channels") != std::string::npos);

  const auto brdf = ScatteredBrdf::make(single({0, 0, 1}, {0, 0, 1}, 1)).value();
  REQUIRE_FALSE(brdf->add({.omega_i = {0, 0, 1},
                           .omega_o = {0, 0, 0},
                           .f_per_sr = {},
                           .random_per_sr = {},
                           .systematic_per_sr = {}})
                    .has_value());
  REQUIRE(brdf->size() == 1);
}

TEST_CASE("Questions from below, zero vectors and NaN have no value") {
  const auto brdf = ScatteredBrdf::make(rings({0}, {0}, 360, ramp)).value();
  const double nan = std::nan("");
  const Direction up{0, 0, 1};
  for (const Direction& bad : {Direction{0, 0, -1}, Direction{0, 0, 0}, Direction{nan, nan, nan}}) {
    REQUIRE(at(*brdf, bad, up).origin == Origin::kInvalid);
  }
  REQUIRE(at(*brdf, up, {0, 0, -1}).origin == Origin::kInvalid);
  REQUIRE(at(*brdf, up, {nan, 0, 1}).origin == Origin::kInvalid);
}
