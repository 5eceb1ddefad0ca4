#include <catch2/catch.hpp>

#include "simulator/faults/fault_plan.h"

using namespace scatter;
using namespace scatter::simulator;

namespace {

FaultPlan plan_of(std::string_view text) {
  FaultPlan plan;
  const Status added = add_faults(text, plan);
  INFO(text);
  REQUIRE(added.has_value());
  return plan;
}

}  // namespace

TEST_CASE("A rate without a direction applies to both directions, with one to that one only") {
  const FaultPlan both = plan_of("drop:1e-3");
  CHECK(both.rates(Direction::kToHost).drop == 1e-3);
  CHECK(both.rates(Direction::kToDevice).drop == 1e-3);
  const FaultPlan one = plan_of("corrupt:0.5:to_device");
  CHECK(one.rates(Direction::kToHost).corrupt == 0);
  CHECK(one.rates(Direction::kToDevice).corrupt == 0.5);
}

TEST_CASE("Every named fault is known, and faults join with plus") {
  const FaultPlan plan = plan_of(
      "drop:0.1+corrupt:0.2+duplicate:0.3+reorder:0.4+truncate:0.5+garbage:0.6+stall:100:250+"
      "disconnect:7:to_device+usb_stall:0.8+usb_short:0.9+usb_babble:1+readout:0.7+led:3+led:4+reset:9");
  const LinkRates& rates = plan.rates(Direction::kToHost);
  CHECK(rates.drop == 0.1);
  CHECK(rates.corrupt == 0.2);
  CHECK(rates.duplicate == 0.3);
  CHECK(rates.reorder == 0.4);
  CHECK(rates.truncate == 0.5);
  CHECK(rates.garbage == 0.6);
  REQUIRE(plan.stalls.size() == 1);
  CHECK(plan.stalls[0].at_byte == 100);
  CHECK(plan.stalls[0].duration_us == 250'000U);
  CHECK(plan.stalls[0].direction == Direction::kToHost);
  REQUIRE(plan.disconnects.size() == 1);
  CHECK(plan.disconnects[0].at_byte == 7);
  CHECK(plan.disconnects[0].direction == Direction::kToDevice);
  CHECK(plan.usb.stall == 0.8);
  CHECK(plan.usb.short_read == 0.9);
  CHECK(plan.usb.babble == 1);
  CHECK(plan.readout == 0.7);
  CHECK(plan.dead_leds == std::vector<std::uint8_t>{3, 4});
  CHECK(plan.reset_at_frame == std::vector<std::uint64_t>{9});
  CHECK_FALSE(plan_of("stall:5").stalls[0].duration_us.has_value());
}

TEST_CASE("A wrong fault is refused with its name and a remedy, and changes nothing") {
  for (const std::string_view text : {"",
                                      "drop",
                                      "drop:",
                                      "drop:2",
                                      "drop:-0.1",
                                      "drop:nan",
                                      "drop:0.1:0.2",
                                      "drop:0.1x",
                                      "stall:1:2:3",
                                      "stall:x",
                                      "stall:1:y",
                                      "disconnect:-1",
                                      "readout:0.1:to_host",
                                      "usb_stall:0.1:to_host",
                                      "usb_short:1.1",
                                      "usb_babble:",
                                      "usb_drop:0.1",
                                      "led:256",
                                      "led:0:to_device",
                                      "reset:0",
                                      "reset:one",
                                      "dorp:0.1",
                                      "drop:0.1+",
                                      "+drop:0.1",
                                      "drop:0.1:sideways"}) {
    INFO(text);
    FaultPlan plan;
    const Status added = add_faults(text, plan);
    REQUIRE_FALSE(added.has_value());
    CHECK(added.error().code == ErrorCode::kInvalidArgument);
    CHECK_FALSE(added.error().what.empty());
    CHECK(added.error().remedy.find("drop:RATE") != std::string::npos);
    CHECK_FALSE(plan.usb.any());
    CHECK_FALSE(plan.rates(Direction::kToHost).any());
    CHECK_FALSE(plan.rates(Direction::kToDevice).any());
  }
}
