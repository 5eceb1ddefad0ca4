#include "simulator/corrosion/growth_options.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <functional>
#include <limits>
#include <string>

#include "simulator/corrosion/growth.h"

namespace scatter::corrosion {
namespace {

TEST_CASE("Growth: every bad option is refused with its name and its range, in both modes") {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  struct Case {
    std::function<void(GrowthOptions&)> spoil;
    const char* what;
    const char* remedy;
  };
  const Case cases[] = {
      {[](GrowthOptions& o) { o.mode = static_cast<Mode>(9); }, "mode: ", "thesis, physical"},
      {[](GrowthOptions& o) { o.corrosivity = static_cast<Corrosivity>(5); }, "corrosivity: ", "very high"},
      {[](GrowthOptions& o) { o.law = static_cast<Law>(2); }, "law: ", "iso9224"},
      {[](GrowthOptions& o) { o.border = static_cast<Border>(2); }, "border: ", "clamped"},
      {[=](GrowthOptions& o) { o.age_years = nan; }, "age: is nan", "0 to 100 years"},
      {[](GrowthOptions& o) { o.age_years = INFINITY; }, "age: is inf", "0 to 100 years"},
      {[](GrowthOptions& o) { o.side = 0; }, "side: is 0", "8 to 16384"},
      {[](GrowthOptions& o) { o.side = 7; }, "side: is 7", "8 to 16384"},
      {[](GrowthOptions& o) { o.side = std::size_t{1} << 40U; }, "side: ", "8 to 16384"},
      {[](GrowthOptions& o) { o.extent_mm = 0; }, "extent_mm: is 0", "0.1 to 10000 mm"},
      {[=](GrowthOptions& o) { o.extent_mm = nan; }, "extent_mm: is nan", "0.1 to 10000 mm"},
      {[](GrowthOptions& o) { o.thickness_mm = 0; }, "thickness_mm: is 0", "0.001 to 1000 mm"},
      {[](GrowthOptions& o) { o.thickness_mm = -1; }, "thickness_mm: is -1", "0.001 to 1000 mm"},
      {[](GrowthOptions& o) { o.starting_points = 0; }, "starting_points: 0", "1 to 256"},
      {[](GrowthOptions& o) { o.starting_points = 257; }, "starting_points: 257", "1 to 256"},
      {[](GrowthOptions& o) { o.surface = {2, 2, {0, 1, 0}}; }, "surface: 2 x 2 cells have 3 values",
       "one value"},
      {[=](GrowthOptions& o) { o.material.values = {static_cast<float>(nan)}; },
       "material: column 0, row 0 is nan", "0 to 1"},
      {[](GrowthOptions& o) { o.exposure.values = {-0.5F}; }, "exposure: column 0, row 0 is -0.5",
       "from 0 to"},
      {[](GrowthOptions& o) { o.opening.values = {2.0F}; }, "opening: column 0, row 0 is 2", "0 to 1"},
      {[](GrowthOptions& o) { o.least_susceptibility = 1.5; }, "least_susceptibility: is 1.5", "0 to 1"},
      {[](GrowthOptions& o) { o.late_points = -1; }, "late_points: is -1", "0 to 100000"},
      {[](GrowthOptions& o) { o.reserve = 1.01; }, "reserve: is 1.01", "0 to 1"},
      {[](GrowthOptions& o) { o.events.bite = 0; }, "events.bite: is 0", "to 1"},
      {[=](GrowthOptions& o) { o.front.front_sigma = nan; }, "front.front_sigma: is nan", "0 to 3"},
      // Nothing that may corrode is left for the starting points.
      {[](GrowthOptions& o) { o.exposure.values = {0.0F}; }, "starting_points: ", "1"},
      {[](GrowthOptions& o) { o.opening.values = {0.0F}; }, "starting_points: ", "1"},
  };
  for (const Mode mode : {Mode::kThesis, Mode::kPhysical}) {
    for (const Case& bad : cases) {
      GrowthOptions options;
      options.mode = mode;
      options.side = 16;
      bad.spoil(options);
      const auto result = Growth::run(options);
      REQUIRE(!result);
      INFO(result.error().what << " / " << result.error().remedy);
      CHECK(result.error().code == ErrorCode::kInvalidArgument);
      CHECK(result.error().what.find(bad.what) == 0);
      CHECK(result.error().remedy.find(bad.remedy) != std::string::npos);
    }
  }
}

TEST_CASE("Growth: ages out of range are taken as the nearest, and a note says so") {
  for (const Mode mode : {Mode::kThesis, Mode::kPhysical}) {
    GrowthOptions options;
    options.mode = mode;
    options.side = 16;
    options.age_years = 150;
    const auto old = Growth::run(options);
    REQUIRE(old);
    CHECK((*old)->options().age_years == 100);
    REQUIRE((*old)->notes().size() == 1);
    CHECK((*old)->notes()[0] == "age 150 is taken as 100 years");
    options.age_years = -5;
    const auto young = Growth::run(options);
    REQUIRE(young);
    CHECK((*young)->notes()[0] == "age -5 is taken as 0 years");
    CHECK((*young)->at(0)->mass_loss_g_per_m2 == 0);
    options.age_years = 20;
    const auto plain = Growth::run(options);
    REQUIRE(plain);
    CHECK((*plain)->notes().empty());
    CHECK((*plain)->at(50)->age_years == 20);
    CHECK((*plain)->at(-3)->age_years == 0);
    CHECK((*plain)->at(INFINITY).error().what == "age: is inf years");
  }
}

TEST_CASE("Growth: each wants finite ages that do not fall") {
  GrowthOptions options;
  options.mode = Mode::kThesis;
  options.side = 16;
  const auto growth = *Growth::run(options);
  const auto ignore = [](const Sheet&) {};
  const double falling[] = {1, 5, 4};
  const double broken[] = {1, std::numeric_limits<double>::quiet_NaN()};
  CHECK(growth->each(falling, ignore).error().what == "ages: entry 2 is 4 years after 5");
  CHECK(!growth->each(broken, ignore));
  CHECK(growth->each({}, ignore));
}

}  // namespace
}  // namespace scatter::corrosion
