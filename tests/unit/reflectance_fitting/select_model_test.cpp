#include <catch2/catch.hpp>

#include "host_sdk/reflectance/fitting/fit.h"
#include "tests/unit/reflectance_fitting/made_samples.h"

namespace scatter::reflectance {
namespace {

SelectOptions among(std::initializer_list<const char*> names) {
  SelectOptions options;
  options.families.clear();
  for (const char* text : names) {
    options.families.push_back(fit_family(text).value());
  }
  return options;
}

}  // namespace

TEST_CASE("Cross-validation finds the family that made the data", "[select_model]") {
  const std::vector<std::pair<const char*, const char*>> truths{
      {"lambert", "lambertian:0.3/0.4/0.5"},        {"oren-nayar", "oren-nayar:albedo=0.4,sigma=0.6"},
      {"ggx", "ggx:alpha=0.2,f0=0.1,albedo=0.2"},   {"beckmann", "beckmann:alpha=0.2,f0=0.1,albedo=0.2"},
      {"ward", "ward:alpha=0.2,ks=0.2,albedo=0.2"}, {"lafortune", "lafortune:n=60,ks=0.2,albedo=0.2"}};
  for (const auto& [family, truth] : truths) {
    FitSamples samples = test::samples_of(truth, 500);
    test::add_noise(samples, 0.01, 0, 17);
    const auto selection =
        select_model(samples, among({"lambert", "oren-nayar", "lafortune", "ward", "ggx", "beckmann"}));
    REQUIRE(selection);
    CAPTURE(family);
    CHECK(name(selection->best.family) == family);
    REQUIRE(selection->scores.size() == 6);
    for (const FamilyScore& score : selection->scores) {
      if (name(score.family) == family) {
        // What is left of the right family is the noise.
        CHECK(score.rms_residual == Approx(0.01).epsilon(0.15));
        CHECK(score.incidence_residual.size() == 4);
      }
    }
  }
}

TEST_CASE("Of families that predict alike the one with fewer parameters wins", "[select_model]") {
  FitSamples samples = test::samples_of("ggx:alpha=0.2,f0=0.1,albedo=0.2", 500);
  test::add_noise(samples, 0.01, 0, 17);
  const auto selection = select_model(samples, among({"ggx2", "oren-nayar+ggx", "ggx"}));
  REQUIRE(selection);
  CHECK(name(selection->best.family) == "ggx");
}

TEST_CASE("Among families that leave only rounding the one with the fewest parameters wins",
          "[select_model]") {
  const FitSamples samples = test::samples_of("lambertian:0.3", 500);
  const auto selection = select_model(samples, among({"oren-nayar+ward", "oren-nayar", "ggx", "lambert"}));
  REQUIRE(selection);
  CHECK(name(selection->best.family) == "lambert");
}

TEST_CASE("Selection without two incidences is refused, and can be stopped", "[select_model]") {
  const SelectOptions two = among({"lambert", "ggx"});
  CHECK(select_model(test::samples_of("lambertian:0.3", 100, {20}), two).error().code ==
        ErrorCode::kFailedPrecondition);
  std::stop_source stop;
  SelectOptions options = among({"lambert", "ggx"});
  options.fit.stop = stop.get_token();
  options.progress = [&](double fraction, const std::string&) {
    CHECK(fraction >= 0);
    CHECK(fraction <= 1);
    stop.request_stop();
  };
  const auto stopped = select_model(test::samples_of("lambertian:0.3", 100), options);
  REQUIRE_FALSE(stopped);
  CHECK(stopped.error().code == ErrorCode::kAborted);
}

}  // namespace scatter::reflectance
