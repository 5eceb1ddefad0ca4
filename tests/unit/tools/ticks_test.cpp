#include "tools/plot/ticks.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <limits>

using namespace scatter::plot;

TEST_CASE("Linear marks stand at 1, 2 or 5 times a power of ten and hold the whole axis") {
  const Axis axis = choose_axis(0.12, 0.17, Scale::kAuto);
  CHECK_FALSE(axis.log);
  CHECK(axis.low == 0);
  CHECK(axis.high >= 0.17);
  const auto marks = ticks(axis, 5);
  REQUIRE(marks.size() >= 3);
  const double step = marks[1].value - marks[0].value;
  const double mantissa = step / std::pow(10, std::floor(std::log10(step) + 1e-9));
  CHECK((std::abs(mantissa - 1) < 1e-9 || std::abs(mantissa - 2) < 1e-9 || std::abs(mantissa - 5) < 1e-9));
}

TEST_CASE("An axis is logarithmic when its values span more than a factor of 5") {
  CHECK(choose_axis(0.01, 0.049, Scale::kAuto).log == false);
  const Axis axis = choose_axis(0.01, 0.051, Scale::kAuto);
  CHECK(axis.log);
  CHECK(axis.place(0.01) == Approx(0).margin(1e-12));
  CHECK(axis.place(0.051) == Approx(1));
  CHECK(axis.place(std::sqrt(0.01 * 0.051)) == Approx(0.5));
  CHECK(axis.place(0) < -1);
}

TEST_CASE("An axis exists for any values") {
  const double infinite = std::numeric_limits<double>::infinity();
  const double none = std::nan("");
  for (const auto& [low, high] : {std::pair{0.0, 0.0},
                                  {infinite, -infinite},
                                  {none, none},
                                  {-1.0, -0.5},
                                  {0.0, 1e-300},
                                  {1e300, 1e308},
                                  {-1.0, infinite},
                                  {1.0, 1.0}}) {
    for (const Scale scale : {Scale::kAuto, Scale::kLinear, Scale::kLog}) {
      const Axis axis = choose_axis(low, high, scale);
      REQUIRE(axis.high > axis.low);
      REQUIRE(std::isfinite(axis.place(0.5 * (axis.low + axis.high))));
      REQUIRE(ticks(axis, 6).size() < 200);
    }
  }
}

TEST_CASE("A logarithmic axis over many decades labels powers of ten only") {
  for (const Tick& tick : ticks({1e-4, 100, true}, 7)) {
    if (!tick.label.empty()) {
      const double power = std::log10(tick.value);
      CHECK(std::abs(power - std::round(power)) < 1e-9);
    }
  }
}

TEST_CASE("Numbers are written briefly") {
  CHECK(short_number(0) == "0");
  CHECK(short_number(0.001) == "0.001");
  CHECK(short_number(0.25) == "0.25");
  CHECK(short_number(150) == "150");
  CHECK(short_number(3e-5) == "3×10⁻⁵");
  CHECK(short_number(1e-6) == "10⁻⁶");
  CHECK(short_number(2e12) == "2×10¹²");
}

TEST_CASE("Angles are written to a thousandth of a degree") {
  CHECK(angle_text(0.3490658503988659) == "20°");
  CHECK(angle_text(8.7e-8) == "0°");
  CHECK(angle_text(-8.7e-8) == "0°");
  CHECK(angle_text(0.35) == "20.054°");
}
