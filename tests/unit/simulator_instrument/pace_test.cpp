#include "simulator/instrument/pace.h"

#include <catch2/catch.hpp>

#include "firmware/core/step.h"

namespace {

using scatter::firmware::kLongestSleepUs;
using scatter::simulator::ClockMode;
using scatter::simulator::Pace;

TEST_CASE("Virtual time goes to the next event without waiting for it") {
  Pace pace(ClockMode::kVirtual);
  CHECK(pace.wait_us(500, 500 + kLongestSleepUs - 1, false) == 0);
  CHECK(pace.time_after_wait() == 500 + kLongestSleepUs - 1);
}

TEST_CASE("Virtual time goes with the computer's clock while nothing is due") {
  Pace pace(ClockMode::kVirtual);
  CHECK(pace.wait_us(500, 500 + kLongestSleepUs, false) == kLongestSleepUs);
  const auto time = pace.time_after_wait();
  REQUIRE(time.has_value());
  CHECK(*time >= 500);
  CHECK(*time <= 500 + kLongestSleepUs);
}

TEST_CASE("Virtual time stands still while the host does not take what was sent") {
  Pace pace(ClockMode::kVirtual);
  CHECK(pace.wait_us(500, 501, true) >= 1000);  // Or the server would spin.
  CHECK_FALSE(pace.time_after_wait().has_value());
}

TEST_CASE("A real clock passes by itself, and the wait ends when something is due") {
  Pace pace(ClockMode::kReal);
  CHECK(pace.wait_us(500, 800, false) == 300);
  CHECK_FALSE(pace.time_after_wait().has_value());
  CHECK(pace.wait_us(800, 700, false) == 0);
}

}  // namespace
