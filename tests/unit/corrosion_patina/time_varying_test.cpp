// Appearance of a corroding sheet as a product of space and time.
#include "simulator/corrosion/time_varying.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>

#include "simulator/corrosion/front_growth.h"

namespace scatter::corrosion {
namespace {

GrowthOptions small_sheet() {
  GrowthOptions options;
  options.corrosivity = Corrosivity::kVeryHigh;
  options.age_years = 12;
  options.starting_points = 12;
  options.side = 96;
  options.extent_mm = 20;
  options.thickness_mm = 1;
  options.seed = 3;
  return options;
}

std::shared_ptr<const Growth> grown(const GrowthOptions& options) {
  const auto growth = Growth::run(options);
  REQUIRE(growth);
  return *growth;
}

float of(const Appearance& look, const Sheet& sheet, LookParameter parameter, std::size_t cell) {
  switch (parameter) {
    case LookParameter::kRed:
    case LookParameter::kGreen:
    case LookParameter::kBlue:
      return look.albedo[cell][static_cast<std::size_t>(parameter)];
    case LookParameter::kRoughness:
      return look.roughness[cell];
    case LookParameter::kPorosity:
      return look.porosity[cell];
    case LookParameter::kMetalness:
      return look.metalness[cell];
    case LookParameter::kOpacity:
      return look.opacity[cell];
    case LookParameter::kHeight:
      return sheet.height[cell];
  }
  return 0;
}

/// Largest difference between A phi + D and the sheet's own appearance, where the skin is complete or rust
/// has not come, and where a rounding of the height could not make a hole of rust.
double worst(const Growth& growth, const TimeVarying& varying, const AppearanceOptions& options, double age,
             std::size_t& compared) {
  const Sheet sheet = *growth.at(age);
  const Appearance look = appearance(sheet, options);
  const FrontView front = *front_of(growth);
  const std::array<double, 1> ages{age};
  const double clock = front_clock_mm(growth, ages)[0];
  double difference = 0;
  for (std::size_t i = 0; i < sheet.cells(); ++i) {
    const double since = clock - static_cast<double>(front.births_mm[i]);
    const bool rim = since > -1e-4 && since < front.skin_width_mm;
    const bool brink = sheet.height[i] < 1e-4F && varying.local_time(i, clock) < 996;
    if (rim || brink) {
      continue;
    }
    ++compared;
    for (std::size_t p = 0; p < kLookParameters; ++p) {
      const auto parameter = static_cast<LookParameter>(p);
      difference = std::max(difference, std::abs(static_cast<double>(varying.value(parameter, i, clock)) -
                                                 static_cast<double>(of(look, sheet, parameter, i))));
    }
  }
  return difference;
}

TEST_CASE("A phi + D is the sheet's appearance at every age, wherever the skin is complete") {
  const GrowthOptions options = small_sheet();
  const auto growth = grown(options);
  const TimeVarying varying = *TimeVarying::make(*growth);
  std::size_t compared = 0;
  for (const double age : {0.0, 0.5, 2.0, 6.0, 12.0}) {
    INFO("age " << age);
    CHECK(worst(*growth, varying, {}, age, compared) < 1e-3);
  }
  CHECK(compared > 3 * 96 * 96);  // Of 5: the rest is rim.
  CHECK(varying.albedo_error == 0);
}

TEST_CASE("In the rim, depth is too large by no more than the skin") {
  const GrowthOptions options = small_sheet();
  const auto growth = grown(options);
  const TimeVarying varying = *TimeVarying::make(*growth);
  for (const double age : {1.0, 5.0}) {
    const std::array<double, 1> ages{age};
    const double clock = front_clock_mm(*growth, ages)[0];
    const Sheet sheet = *growth->at(age);
    const std::vector<float> heights = varying.map(LookParameter::kHeight, clock);
    for (std::size_t i = 0; i < heights.size(); ++i) {
      const double too_deep_um =
          1000.0 * (static_cast<double>(sheet.height[i]) - static_cast<double>(heights[i]));
      REQUIRE(too_deep_um > -0.02);
      REQUIRE(too_deep_um < options.front.skin_um + 0.02);
    }
  }
}

TEST_CASE("The thesis's rule, which goes by height, is followed as well") {
  const auto growth = grown(small_sheet());
  AppearanceOptions options;
  options.rule = LookRule::kByHeight;
  const TimeVarying varying = *TimeVarying::make(*growth, options);
  // Cells whose height is within rounding of a limit may fall on either side of it.
  std::size_t compared = 0;
  const Sheet sheet = *growth->at(6);
  const Appearance look = appearance(sheet, options);
  const FrontView front = *front_of(*growth);
  const std::array<double, 1> ages{6};
  const double clock = front_clock_mm(*growth, ages)[0];
  for (std::size_t i = 0; i < sheet.cells(); ++i) {
    const double since = clock - static_cast<double>(front.births_mm[i]);
    const auto near = [&](float limit) { return std::abs(sheet.height[i] - limit) < 1e-4F; };
    if ((since > -1e-4 && since < front.skin_width_mm) || near(0.99F) || near(0.07F) || near(0.0F)) {
      continue;
    }
    ++compared;
    for (std::size_t p = 0; p < kLookParameters; ++p) {
      const auto parameter = static_cast<LookParameter>(p);
      INFO(name(parameter) << " where the height is " << sheet.height[i]);
      REQUIRE(varying.value(parameter, i, clock) == Approx(of(look, sheet, parameter, i)).margin(1e-3));
    }
  }
  CHECK(compared > 96 * 96 / 2);
}

TEST_CASE("Without amplitude nothing changes with time") {
  const auto growth = grown(small_sheet());
  TimeVarying varying = *TimeVarying::make(*growth);
  for (TimeVarying::Factor& factor : varying.factors) {
    factor.amplitude = {1, 1, {0.0F}};
    factor.constant = {1, 1, {0.42F}};
  }
  for (const double clock : {-1.0, 0.0, 0.7, 30.0}) {
    for (const float value : varying.map(LookParameter::kRed, clock)) {
      REQUIRE(value == 0.42F);
    }
  }
}

TEST_CASE("Moving the offset by R dt is moving time by dt: p(t; O + R dt) = p(t - dt; O)") {
  const auto growth = grown(small_sheet());
  const TimeVarying varying = *TimeVarying::make(*growth);
  TimeVarying later = varying;
  constexpr double kDelay = 0.375;  // mm of the clock
  for (std::size_t i = 0; i < later.offset.size(); ++i) {
    later.offset[i] = static_cast<float>(static_cast<double>(later.offset[i]) +
                                         kDelay * static_cast<double>(later.rate[i]));
  }
  for (const double clock : {0.5, 1.5, 4.0}) {
    for (const LookParameter parameter :
         {LookParameter::kGreen, LookParameter::kRoughness, LookParameter::kHeight}) {
      const std::vector<float> delayed = later.map(parameter, clock);
      const std::vector<float> before = varying.map(parameter, clock - kDelay);
      for (std::size_t i = 0; i < delayed.size(); ++i) {
        // But where rounding decides whether rust has come.
        if (std::abs(varying.local_time(i, clock - kDelay)) > 1e-3) {
          REQUIRE(delayed[i] == Approx(before[i]).margin(1e-5));
        }
      }
    }
  }
}

TEST_CASE("A curve is straight between knots, steps where two share a time, and rests outside") {
  const TemporalCurve curve{{{0, 1.0F}, {0, 3.0F}, {2, 5.0F}}};
  CHECK(curve.at(-1e9) == 1);
  CHECK(curve.at(-1e-12) == 1);
  CHECK(curve.at(0) == 3);
  CHECK(curve.at(0.5) == Approx(3.5));
  CHECK(curve.at(2) == 5);
  CHECK(curve.at(1e30) == 5);
}

TEST_CASE("The clock between its ticks is the growth's own") {
  const GrowthOptions options = small_sheet();
  const auto growth = grown(options);
  const TimeVarying varying = *TimeVarying::make(*growth);
  CHECK(varying.clock_mm(0) == -1);
  CHECK(varying.clock_mm(-3) == -1);
  CHECK(varying.clock_mm(12) == varying.clock_mm(500));
  const std::vector<double> ages{0.15, 0.333, 1.77, 5.05, 9.999, 12};
  const std::vector<double> exact = front_clock_mm(*growth, ages);
  for (std::size_t k = 0; k < ages.size(); ++k) {
    CHECK(varying.clock_mm(ages[k]) == Approx(exact[k]).margin(1e-3 * exact.back() / 12));
  }
}

TEST_CASE(
    "Textured layers: one colour that scales over the sheet is followed exactly, others with the error "
    "stated") {
  const auto growth = grown(small_sheet());
  AppearanceOptions scaled;
  for (std::size_t layer = 0; layer < 4; ++layer) {
    const Rgb base = scaled.layers[layer].values[0];
    // Left half half as bright: A is the brightness there.
    const Rgb dim{base[0] / 2, base[1] / 2, base[2] / 2};
    scaled.layers[layer] = {2, 1, {dim, base}};
  }
  const TimeVarying exact = *TimeVarying::make(*growth, scaled);
  CHECK(exact.albedo_error == Approx(0).margin(1e-6));
  std::size_t compared = 0;
  CHECK(worst(*growth, exact, scaled, 6, compared) < 1e-3);

  AppearanceOptions other = scaled;
  other.layers[1] = {2, 1, {Rgb{0.9F, 0.1F, 0.5F}, Rgb{0.1F, 0.8F, 0.2F}}};
  const TimeVarying near = *TimeVarying::make(*growth, other);
  CHECK(near.albedo_error > 0.01);
  CHECK(near.albedo_error < 0.3);
}

TEST_CASE("Openings are holes from the start and places that rust never reaches stay metal") {
  GrowthOptions options = small_sheet();
  options.age_years = 3;
  options.opening = {2, 2, {0.0F, 1.0F, 1.0F, 1.0F}};
  const auto growth = grown(options);
  const TimeVarying varying = *TimeVarying::make(*growth);
  const FrontView front = *front_of(*growth);
  bool some_open = false;
  bool some_never = false;
  for (std::size_t i = 0; i < varying.offset.size(); ++i) {
    const bool open = front.opening[i] != 0;
    const bool never = !open && std::isinf(front.births_mm[i]);
    for (const double clock : {0.0, 1.0, 50.0}) {
      if (open) {
        REQUIRE(varying.value(LookParameter::kOpacity, i, clock) == 0);
      } else if (never) {
        REQUIRE(varying.value(LookParameter::kMetalness, i, clock) == 1);
      }
    }
    some_open = some_open || open;
    some_never = some_never || never;
  }
  CHECK(some_open);
  CHECK(some_never);
}

TEST_CASE("A sheet grown by chance has no local time: an error says so") {
  GrowthOptions options = small_sheet();
  options.mode = Mode::kThesis;
  const Result<TimeVarying> result = TimeVarying::make(*grown(options));
  REQUIRE_FALSE(result);
  CHECK(result.error().code == ErrorCode::kInvalidArgument);
  CHECK(front_clock_mm(*grown(options), std::vector<double>{1}).empty());
}

}  // namespace
}  // namespace scatter::corrosion
