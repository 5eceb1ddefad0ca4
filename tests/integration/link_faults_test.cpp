// The fault matrix of the link: every fault against commands and against a stream of known pixels.
// PROVES: spec/protocol.md section 5, rows for bit flips, truncation, duplication, reordering, garbage,
// stall, unplug and device reset; columns for command and stream.
#include <fmt/format.h>

#include <string_view>

#include "tests/integration/rig.h"

using namespace scatter;
using namespace scatter::integration;
using device::Device;

namespace {

Device open_known(const std::shared_ptr<simulator::VirtualInstrument>& instrument) {
  auto device = open_on(instrument);
  if (!device) {
    FAIL(device.error().what);
  }
  return std::move(*device);
}

constexpr std::string_view kLossyFaults[]{"drop:0.05", "corrupt:0.05", "truncate:0.05"};
constexpr std::string_view kHarmlessFaults[]{"duplicate:0.1", "reorder:0.1", "garbage:0.1"};

Outcome run_pattern(std::string_view fault, std::uint16_t frames) {
  const auto instrument = instrument_of(fmt::format("fault={}&seed=11", fault));
  Device device = open_known(instrument);
  return run(device, pattern_recipe(frames));
}

}  // namespace

TEST_CASE("Commands succeed, each executed once, whatever the link does to single frames") {
  for (const std::string_view fault :
       {"drop:0.1", "corrupt:0.1", "truncate:0.1", "duplicate:0.3", "reorder:0.3", "garbage:0.3",
        "drop:0.05+corrupt:0.05+duplicate:0.1+reorder:0.1+truncate:0.05+garbage:0.1"}) {
    INFO(fault);
    const auto instrument = instrument_of(fmt::format("fault={}&seed=5", fault));
    Device device = open_known(instrument);
    for (int i = 0; i < 20; ++i) {
      const std::string name = fmt::format("bench {}", i);
      REQUIRE(device.set_key_value("name", name).has_value());
      const auto value = device.key_value("name");
      REQUIRE(value.has_value());
      CHECK(value->value.str() == name);
    }
    const auto begun = device.calibration_begin();
    REQUIRE(begun.has_value());
    protocol::CalibrationManifest manifest;
    manifest.id.fill(1);
    for (int i = 0; i < 20; ++i) {
      REQUIRE(device.calibration_commit(begun->session, manifest).has_value());
    }
    const auto manifests = device.calibration_list();
    REQUIRE(manifests.has_value());
    REQUIRE_FALSE(manifests->empty());
    // The device counts commits: a repeated request executed twice would count twice.
    CHECK(manifests->front().sequence - manifests->back().sequence == 1);
    CHECK(manifests->front().sequence == 20);
  }
}

TEST_CASE("Lost and damaged wire frames cost whole frames that the ledger counts as lost on the link") {
  constexpr std::uint16_t kFrames = 60;
  for (const std::string_view fault : kLossyFaults) {
    INFO(fault);
    const Outcome outcome = run_pattern(fault, kFrames);
    REQUIRE_FALSE(outcome.error.has_value());
    const protocol::Ledger& ledger = outcome.summary.ledger;
    CHECK(ledger.balances());
    CHECK(ledger.exposed == kFrames);
    CHECK(ledger.delivered == outcome.complete);
    CHECK(ledger.lost_link > 0);
    CHECK(ledger.delivered > 0);
    CHECK(ledger.lost_sensor + ledger.lost_firmware + ledger.lost_host + ledger.corrupt == 0);
    CHECK(outcome.wrong == 0);
    CHECK((fault.starts_with("drop") || outcome.summary.link.bad_frames > 0));
  }
}

TEST_CASE("Repeated and reordered wire frames and garbage between them cost nothing") {
  constexpr std::uint16_t kFrames = 60;
  for (const std::string_view fault : kHarmlessFaults) {
    INFO(fault);
    const Outcome outcome = run_pattern(fault, kFrames);
    REQUIRE_FALSE(outcome.error.has_value());
    CHECK(outcome.summary.ledger.balances());
    CHECK(outcome.summary.ledger.delivered == kFrames);
    CHECK(outcome.complete == kFrames);
    CHECK(outcome.wrong == 0);
    CHECK((fault.starts_with("duplicate") == (outcome.summary.link.duplicate_chunks > 0)));
    CHECK((fault.starts_with("garbage") == (outcome.summary.link.skipped_bytes > 0)));
  }
}

TEST_CASE("All link faults together: no hang, no wrong pixel, a ledger that balances, for ten seeds") {
  for (int seed = 0; seed < 10; ++seed) {
    INFO(seed);
    const auto instrument = instrument_of(fmt::format(
        "fault=drop:0.02+corrupt:0.02+duplicate:0.05+reorder:0.05+truncate:0.02+garbage:0.05&seed={}", seed));
    Device device = open_known(instrument);
    const Outcome outcome = run(device, pattern_recipe(40));
    REQUIRE_FALSE(outcome.error.has_value());
    CHECK(outcome.summary.ledger.balances());
    CHECK(outcome.summary.ledger.exposed == 40);
    CHECK(outcome.wrong == 0);
  }
}

TEST_CASE("A short stall delays and loses nothing") {
  const Outcome outcome = run_pattern("stall:100000:200", 40);
  REQUIRE_FALSE(outcome.error.has_value());
  CHECK(outcome.summary.ledger.delivered == 40);
  CHECK(outcome.wrong == 0);
}

TEST_CASE("A stall for ever ends in a deadline, at that deadline") {
  const auto instrument = instrument_of("fault=stall:100000");
  Device device = open_known(instrument);
  const device::Wait wait{.timeout = std::chrono::seconds(2)};
  const Outcome outcome = run(device, pattern_recipe(40), wait);
  REQUIRE(outcome.error.has_value());
  CHECK(outcome.error->code == ErrorCode::kDeadlineExceeded);
  CHECK(outcome.summary.ledger.balances());
  CHECK(outcome.wrong == 0);
  const std::uint64_t before = instrument->now_us();
  const auto status = device.status(wait);
  REQUIRE_FALSE(status.has_value());
  CHECK(status.error().code == ErrorCode::kDeadlineExceeded);
  // Deadlines are kept to the microsecond in virtual time; abort on destruction had its own second.
  CHECK(instrument->now_us() - before <= 2'000'000);
}

TEST_CASE("A link that breaks at any point of a stream says so, and a new session starts clean") {
  for (const std::uint64_t position : {20'000ULL, 24'577ULL, 30'000ULL, 33'333ULL, 40'001ULL, 50'000ULL}) {
    INFO(position);
    const auto instrument = instrument_of(fmt::format("fault=disconnect:{}", position));
    std::uint32_t first_run = 0;
    {
      auto device = open_on(instrument);
      if (device) {
        const Outcome outcome = run(*device, pattern_recipe(40));
        REQUIRE(outcome.error.has_value());
        CHECK(outcome.error->code == ErrorCode::kDisconnected);
        CHECK_FALSE(outcome.error->remedy.empty());
        CHECK(outcome.summary.ledger.balances());
        CHECK(outcome.wrong == 0);
        first_run = outcome.summary.run_id;
      } else {
        // The bytes of HELLO and descriptor reach this far.
        CHECK(device.error().code == ErrorCode::kDisconnected);
      }
    }
    Device again = open_known(instrument);
    CHECK(again.hello().run_state == static_cast<std::uint8_t>(protocol::RunState::kIdle));
    const Outcome outcome = run(again, pattern_recipe(10));
    REQUIRE_FALSE(outcome.error.has_value());
    CHECK(outcome.complete == 10);
    CHECK(outcome.wrong == 0);
    CHECK(outcome.summary.ledger.delivered == 10);
    for (const device::Frame& frame : outcome.frames) {
      CHECK(frame.begin.run_id > first_run);
    }
  }
}

TEST_CASE("A device that restarts in a run is seen at once, and tells why when it is opened again") {
  protocol::Recipe recipe = pattern_recipe(1);
  recipe.test_pattern = 0;  // The fault counts exposures of the sensor.
  recipe.repeats = 10;
  const auto instrument = instrument_of("fault=reset:4");
  {
    Device device = open_known(instrument);
    const Outcome outcome = run(device, recipe);
    REQUIRE(outcome.error.has_value());
    CHECK(outcome.error->code == ErrorCode::kDisconnected);
    CHECK(outcome.complete == 3);
    CHECK(outcome.summary.ledger.balances());
  }
  Device again = open_known(instrument);
  CHECK(again.hello().reset_reason == static_cast<std::uint8_t>(protocol::ResetReason::kFault));
  CHECK(run(again, recipe).complete == 10);
}

TEST_CASE("A failing readout is lost at the sensor, and the ledger says so") {
  protocol::Recipe recipe = pattern_recipe(40);
  recipe.test_pattern = 0;
  const auto instrument = instrument_of("fault=readout:0.1&seed=2");
  Device device = open_known(instrument);
  const Outcome outcome = run(device, recipe);
  REQUIRE_FALSE(outcome.error.has_value());
  CHECK(outcome.summary.ledger.balances());
  CHECK(outcome.summary.ledger.lost_sensor > 0);
  CHECK(outcome.summary.ledger.lost_sensor + outcome.complete == 40);
  CHECK(outcome.summary.ledger.lost_link == 0);
}
