// PROVES: instrument.md section 4, step 10.
#include <catch2/catch.hpp>
#include <cmath>

#include "host_sdk/measurement/process.h"

using namespace scatter;
using namespace scatter::measurement;
using reflectance::GridBrdf;
using reflectance::GridPart;
using reflectance::Origin;
using reflectance::radians;

namespace {

Measurement measurement_of(float f, float random, double phi_i_deg, double rotation_deg,
                           std::size_t theta_count = 76) {
  GridBrdf::Content c;
  c.channels = 1;
  c.theta_count = theta_count;
  GridPart part;
  part.theta_i = radians(20);
  part.phi_i = radians(phi_i_deg);
  part.rotation_rad = radians(rotation_deg);
  const std::size_t nodes = theta_count * 360;
  part.f_per_sr.assign(1, std::vector<float>(nodes, f));
  part.random_per_sr.assign(1, std::vector<float>(nodes, random));
  part.systematic_per_sr.assign(1, std::vector<float>(nodes, 0.002F));
  part.pixels.assign(nodes, 10.0F);
  part.origin.assign(nodes, Origin::kMeasured);
  c.parts.push_back(part);
  auto brdf = GridBrdf::make(std::move(c));
  REQUIRE(brdf);
  return {std::move(*brdf), {}, {}, {}, {}, {}, 0, 0, "r", "c"};
}

const QualityItem* find(const Measurement& m, const std::string& name) {
  for (const QualityItem& item : m.quality) {
    if (item.name == name) {
      return &item;
    }
  }
  return nullptr;
}

}  // namespace

TEST_CASE("Repeats average with weights 1 / random^2; the systematic part does not shrink") {
  std::vector<Measurement> list;
  list.push_back(measurement_of(0.100F, 0.001F, 0, 0));
  list.push_back(measurement_of(0.104F, 0.002F, 0, 0));
  const auto out = combine(std::move(list));
  REQUIRE(out);
  const GridPart& part = out->brdf.content().parts.at(0);
  REQUIRE(out->brdf.content().parts.size() == 1);
  CHECK(part.f_per_sr[0][5000] == Approx((0.100 * 4 + 0.104) / 5));
  CHECK(part.random_per_sr[0][5000] == Approx(0.001 / std::sqrt(1.25)));
  CHECK(part.systematic_per_sr[0][5000] == Approx(0.002));
  CHECK(part.pixels[5000] == Approx(20));
  REQUIRE(find(*out, "repeatability_chi_square") != nullptr);
  // Two values 0.004 apart with variances 1 and 4 (1e-6): chi-square = 16 / 5 for one degree of freedom.
  CHECK(find(*out, "repeatability_chi_square")->value == Approx(3.2).epsilon(1e-3));
  CHECK(find(*out, "repeatability_chi_square")->verdict == Verdict::kWarn);
}

TEST_CASE("Repeats that agree better than their random uncertainty share noise that does not average out") {
  // Equal values: nothing of the random uncertainty is their own, so the mean keeps all of it.
  std::vector<Measurement> list;
  for (int k = 0; k < 3; ++k) {
    list.push_back(measurement_of(0.100F, 0.001F, 0, 0));
  }
  const auto out = combine(std::move(list));
  REQUIRE(out);
  CHECK(out->brdf.content().parts.at(0).random_per_sr[0][5000] == Approx(0.001));
}

TEST_CASE("Rotations stay apart as one anisotropic BRDF, and their difference is told") {
  std::vector<Measurement> list;
  list.push_back(measurement_of(0.10F, 0.001F, 0, 0));
  list.push_back(measurement_of(0.15F, 0.001F, 270, 90));
  const auto out = combine(std::move(list));
  REQUIRE(out);
  CHECK(out->brdf.content().parts.size() == 2);
  REQUIRE(find(*out, "anisotropy") != nullptr);
  CHECK(find(*out, "anisotropy")->value == Approx(2 * 0.05 / 0.25).epsilon(1e-3));
}

TEST_CASE("Measurements on different grids are refused") {
  std::vector<Measurement> list;
  list.push_back(measurement_of(0.1F, 0.001F, 0, 0));
  list.push_back(measurement_of(0.1F, 0.001F, 0, 0, 46));
  const auto out = combine(std::move(list));
  REQUIRE_FALSE(out);
  CHECK(out.error().code == ErrorCode::kInvalidArgument);
}
