// What `inspect` and `compare` may claim, and at which incidences.
#include <catch2/catch.hpp>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>

#include "tests/unit/tools/answer.h"
#include "tests/unit/tools/command.h"

using nlohmann::json;

namespace {

/// A BiRD list of one direction, which a search by whole degrees meets, and a long metadata key.
std::string one_direction(const char* f) {
  return std::string(R"({"metadata": {"type": "BRDF", "a_key_that_is_long": {"and_nested_twice": "value"}},
"data": {"theta_i": {"unit": "deg", "values": [30]}, "phi_i": {"unit": "deg", "values": [0]},
"theta_r": {"unit": "deg", "values": [10]}, "phi_r": {"unit": "deg", "values": [60]},
"wavelength_i": {"unit": "nm", "values": [550]}, "BRDF": {"unit": "sr^-1", "values": [)") +
         f + "]}}}";
}

}  // namespace

TEST_CASE("inspect does not call energy conserved that a model gains at grazing light") {
  const auto energy = answer({"inspect", "phong:n=20,ks=2,kd=0.1", "--json"})["energy"];
  CHECK(energy["conserved"] == false);
  CHECK(energy["largest_at_deg"].get<double>() >= 85);
}

TEST_CASE("inspect cannot tell the energy of one direction, and warns of its negative value") {
  const Scratch folder;
  const std::string file = folder / "one.brdf";
  std::ofstream(file) << one_direction("-0.25");
  const auto found = answer({"inspect", file, "--json"});
  CHECK(found["energy"]["conserved"].is_null());
  CHECK(found["energy"]["largest_albedo"].is_null());
  CHECK(found["incidences_deg"].size() == 1);
  CHECK(found["incidences_deg"][0].get<double>() == Approx(30));
  CHECK(found["negative_values"]["count"] == 1);
  CHECK(found["metadata"].contains("bird.a_key_that_is_long.and_nested_twice"));
  const std::string text = scatter({"inspect", file}).out;
  CHECK(text.find("cannot be told: no incidence has values") != std::string::npos);
  CHECK(text.find("negative, down to -0.25 1/sr") != std::string::npos);
  // A long key has its own line and widens no column.
  CHECK(text.find("\nbird.a_key_that_is_long.and_nested_twice\n") != std::string::npos);
}

TEST_CASE("inspect and compare judge an adaptive file at its own incidences, and show its metadata") {
  const Scratch folder;
  const std::string file = folder / "own.bsdf";
  const std::string model = "ggx:alpha=0.3,f0=0.04,albedo=0.3";
  REQUIRE(scatter({"convert", model, file, "--format", "rgl", "--incidences", "0,25,50"}).status == 0);
  const auto found = answer({"inspect", file, "--json"});
  REQUIRE(found["incidences_deg"].size() == 3);
  CHECK(found["incidences_deg"][1].get<double>() == Approx(25).margin(1e-3));
  CHECK(found["coverage"]["interpolated"].get<double>() == 0);
  CHECK_FALSE(found["metadata"].empty());
  // In the default region too, where only measured directions count.
  const auto apart = answer({"compare", file, model, "--json"});
  REQUIRE(apart["incidences"].size() == 3);
  CHECK(apart["incidences"][2]["theta_i_deg"].get<double>() == Approx(50).margin(1e-3));
  CHECK(apart["incidences"][2]["bins"].get<int>() > 0);
}

TEST_CASE("compare names a mirror that one of two lacks, and claims no relative error from it") {
  const auto apart = answer({"compare", "lambertian:0", "mirror:0.9", "--region", "all", "--json"});
  CHECK(apart["albedo_error"][0].get<double>() == Approx(0.9));
  CHECK(apart["mean_relative_error"].is_null());
  const std::string text = scatter({"compare", "lambertian:0", "mirror:0.9", "--region", "all"}).out;
  CHECK(text.find("mirror (unscattered) shares differ: 0.0000 against 0.9000") != std::string::npos);
}

TEST_CASE("atlas says how materials of different channels go into one") {
  const Scratch folder;
  const std::string one = folder / "one.exr";
  REQUIRE(scatter({"convert", "lambertian:0.5", one, "--channel", "0"}).status == 0);
  const auto refused = scatter({"atlas", folder / "a.exr", "lambertian:0.5", one});
  CHECK(refused.status != 0);
  CHECK(refused.err.find("has 3 channels") != std::string::npos);
  // The remedy is one: what it names was done above.
  CHECK(refused.err.find("--channel 0") != std::string::npos);
}
