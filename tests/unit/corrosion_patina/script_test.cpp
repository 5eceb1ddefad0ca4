// Scripts: the operators in order, each for its time.
#include "simulator/corrosion/patina/script.h"

#include <algorithm>
#include <catch2/catch.hpp>

namespace scatter::corrosion {
namespace {

LayerStack copper() {
  return *LayerStack::bare(64, 3.2);
}

LayerStack after(std::string_view script, std::uint64_t seed = 1) {
  LayerStack stack = copper();
  const auto steps = script_from(script);
  REQUIRE(steps);
  REQUIRE(apply(stack, *steps, seed));
  return stack;
}

TEST_CASE("A script does its steps in order: coat, coat, erode") {
  const LayerStack stack =
      after("coat:tarnish,rate=0.5,years=4;coat:sulphate,rate=1,years=6;erode:rate=0.1,years=10");
  REQUIRE(stack.layers().size() == 2);
  CHECK(stack.mean_um(PatinaMaterial::kTarnish) == Approx(2));
  CHECK(stack.mean_um(PatinaMaterial::kSulphate) == Approx(5));
  const LayerStack other =
      after("coat:sulphate,rate=1,years=6;erode:rate=1,years=10;coat:tarnish,rate=0.5,years=4");
  CHECK(other.mean_um(PatinaMaterial::kSulphate) == 0);
  CHECK(other.mean_um(PatinaMaterial::kTarnish) == Approx(2));
}

TEST_CASE("Filling, polishing and offsetting happen once, at their level") {
  const LayerStack stack = after(
      "coat:sulphate,rate=1,years=9,deposition=random;fill:chloride,level=7;polish:level=11;offset:tarnish,"
      "radius=1000");
  const std::vector<float> surface = stack.surface_um();
  const auto [lowest, highest] = std::ranges::minmax(surface);
  CHECK(lowest >= 7 - 1e-5F);
  CHECK(highest <= 11 + 1e-5F);
  CHECK(stack.layers().size() == 3);
}

TEST_CASE("A coat by particles has the rate's mean and falls where the rate lets it") {
  for (const Deposition deposition : {Deposition::kRandom, Deposition::kRelaxed, Deposition::kBallistic}) {
    LayerStack stack = copper();
    std::vector<float> rate(64 * 64, 1.0F);
    std::fill_n(rate.begin(), 64 * 32, 0.0F);
    const ScriptStep step{.material = PatinaMaterial::kChloride,
                          .rate = {64, 64, rate},
                          .years = 12,
                          .deposition = deposition,
                          .particle_um = 0.5};
    REQUIRE(apply(stack, std::vector{step}, 3));
    CHECK(stack.mean_um(PatinaMaterial::kChloride) == Approx(6).epsilon(0.002));
    if (deposition != Deposition::kRelaxed) {  // A relaxing particle may roll one column aside.
      const auto& thickness = stack.layers()[0].thickness_um;
      CHECK(std::all_of(thickness.begin(), thickness.begin() + 64 * 32, [](float um) { return um == 0; }));
    }
  }
}

TEST_CASE("The same seed coats alike, another does not") {
  const std::string_view script = "coat:sulphate,rate=1,years=9,deposition=ballistic,particle=0.5";
  CHECK(after(script, 4).surface_um() == after(script, 4).surface_um());
  CHECK(after(script, 4).surface_um() != after(script, 5).surface_um());
}

TEST_CASE("What is not understood is refused with the step's number and its form") {
  const auto refused = [](std::string_view script) {
    const auto steps = script_from(script);
    REQUIRE_FALSE(steps);
    return steps.error().what;
  };
  CHECK(refused("paint:red") == "script: step 1: \"paint\" is no operator");
  CHECK(refused("polish:level=1;coat:gold,rate=1,years=1") == "script: step 2: material \"gold\" is unknown");
  CHECK(refused("polish:height=1") == "script: step 1: \"height=1\" is not understood");
  CHECK(refused("polish:level=much") == "script: step 1: \"level=much\" is not understood");
  CHECK(refused("coat:tarnish,rate=1") ==
        "script: step 1: \"coat:tarnish,rate=1\" lacks a value or has one twice");
  CHECK(refused("erode:rate=1,rate=2,years=1").find("twice") != std::string::npos);
  CHECK(refused(";") == "script: step 1: \"\" is no operator");
  CHECK(script_from("")->empty());
  LayerStack stack = copper();
  const auto beyond = apply(stack, *script_from("coat:tarnish,rate=1,years=2;erode:rate=-1,years=1"), 1);
  REQUIRE_FALSE(beyond);
  CHECK(beyond.error().what.starts_with("script: step 2: "));
  CHECK(stack.mean_um(PatinaMaterial::kTarnish) == Approx(2));
  CHECK_FALSE(apply(stack, *script_from("coat:tarnish,rate=1,years=1e9"), 1));
  CHECK_FALSE(apply(stack, *script_from("coat:tarnish,rate=1,years=1,deposition=random,particle=0"), 1));
  CHECK_FALSE(apply(stack, *script_from("coat:tarnish,rate=900,years=900,deposition=ballistic"), 1));
  CHECK_FALSE(apply(stack, *script_from("offset:tarnish,radius=-1"), 1));
}

}  // namespace
}  // namespace scatter::corrosion
