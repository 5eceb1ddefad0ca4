// The SDK over the virtual USB socket: the same frames as over sim:, and every fault in its column.
// PROVES: spec/protocol.md section 5 for USB: lost and harmed frames, stalls, short transfers, babble,
// unplug, device reset.
#include <fmt/format.h>

#include <algorithm>
#include <string_view>

#include "protocol/codec.h"
#include "simulator/instrument/virtual_board.h"
#include "tests/integration/rig.h"
#include "tests/integration/usb_rig.h"

using namespace scatter;
using namespace scatter::integration;
using device::Device;

namespace {

Device open_known(const std::shared_ptr<simulator::VirtualInstrument>& instrument) {
  auto device = open_usb(instrument);
  if (!device) {
    FAIL(device.error().what);
  }
  return std::move(*device);
}

Outcome run_pattern(std::string_view fault, std::uint16_t frames, std::uint64_t seed = 11) {
  const auto instrument = usb_instrument_of(fmt::format("fault={}&seed={}", fault, seed));
  Device device = open_known(instrument);
  return run(device, pattern_recipe(frames));
}

/// A real exposure with two illuminations and two exposure times.
protocol::Recipe short_recipe() {
  protocol::Recipe recipe;
  recipe.illuminations.push_back(0);
  recipe.illuminations.push_back(3);
  recipe.exposures_us.push_back(1000);
  recipe.exposures_us.push_back(8000);
  recipe.repeats = 3;
  recipe.region_width = recipe.region_height = 48;
  return recipe;
}

std::vector<std::byte> encoded(const protocol::FrameBegin& begin) {
  std::vector<std::byte> bytes(protocol::max_encoded_size<protocol::FrameBegin>());
  bytes.resize(protocol::encode(begin, bytes).value());
  return bytes;
}

bool same_frame(const device::Frame& a, const device::Frame& b) {
  return encoded(a.begin) == encoded(b.begin) && a.status == b.status &&
         std::ranges::equal(a.bytes(), b.bytes());
}

}  // namespace

TEST_CASE("Frames over USB are those of sim: with the same seed, byte for byte") {
  const std::string query = "sample=ggx:alpha=0.2,f0=0.04,albedo=0.3&seed=7";
  auto sim = open_on(instrument_of(query));
  REQUIRE(sim.has_value());
  Device usb = open_known(usb_instrument_of(query));
  for (int i = 0; i < 3; ++i) {
    const Outcome expected = run(*sim, short_recipe());
    const Outcome found = run(usb, short_recipe());
    REQUIRE_FALSE(found.error.has_value());
    REQUIRE(found.frames.size() == expected.frames.size());
    REQUIRE(found.frames.size() == 12);
    for (std::size_t k = 0; k < found.frames.size(); ++k) {
      CHECK(same_frame(found.frames[k], expected.frames[k]));
    }
    CHECK(found.summary.ledger == expected.summary.ledger);
    CHECK(found.summary.ledger.balances());
  }
}

TEST_CASE("The same run over USB repeats exactly, times and faults included") {
  const auto transcript = [] {
    const auto instrument =
        usb_instrument_of("fault=drop:0.02+usb_short:0.1+usb_babble:0.02+usb_stall:0.01&seed=3");
    Device device = open_known(instrument);
    const Outcome outcome = run(device, pattern_recipe(60));
    return std::tuple(outcome.frames.size(), outcome.complete, outcome.summary.ledger, instrument->now_us());
  };
  CHECK(transcript() == transcript());
}

TEST_CASE("Fifty short measurements in a row leave a ledger that balances each time") {
  Device device = open_known(usb_instrument_of("seed=2"));
  for (int i = 0; i < 50; ++i) {
    const Outcome outcome = run(device, pattern_recipe(2));
    REQUIRE_FALSE(outcome.error.has_value());
    CHECK(outcome.complete == 2);
    CHECK(outcome.wrong == 0);
    CHECK(outcome.summary.ledger.balances());
    CHECK(outcome.summary.ledger.delivered == 2);
  }
}

TEST_CASE("Over USB, lost and damaged wire frames are lost on the link in the ledger") {
  constexpr std::uint16_t kFrames = 60;
  for (const std::string_view fault : {"drop:0.05", "corrupt:0.05", "truncate:0.05"}) {
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
  }
}

TEST_CASE("Over USB, repeated, reordered and short transfers and garbage cost nothing") {
  constexpr std::uint16_t kFrames = 60;
  for (const std::string_view fault :
       {"duplicate:0.1", "reorder:0.1", "garbage:0.1", "usb_short:0.3", "usb_short:1"}) {
    INFO(fault);
    const Outcome outcome = run_pattern(fault, kFrames);
    REQUIRE_FALSE(outcome.error.has_value());
    CHECK(outcome.summary.ledger.balances());
    CHECK(outcome.summary.ledger.delivered == kFrames);
    CHECK(outcome.complete == kFrames);
    CHECK(outcome.wrong == 0);
  }
}

TEST_CASE("A babbling transfer costs whole frames that the ledger counts as lost on the link") {
  constexpr std::uint16_t kFrames = 100;
  const auto instrument = usb_instrument_of("fault=usb_babble:0.05&seed=4");
  Device device = open_known(instrument);
  const Outcome outcome = run(device, pattern_recipe(kFrames));
  REQUIRE_FALSE(outcome.error.has_value());
  const protocol::Ledger& ledger = outcome.summary.ledger;
  CHECK(ledger.balances());
  CHECK(ledger.exposed == kFrames);
  CHECK(ledger.lost_link > 0);
  CHECK(ledger.lost_link + ledger.delivered == kFrames);
  CHECK(outcome.wrong == 0);
  CHECK(instrument->board().usb()->usb_fault_counts().babbles >= ledger.lost_link);
}

TEST_CASE("A halted endpoint costs what waited in it, and the stream goes on after the halt") {
  constexpr std::uint16_t kFrames = 100;
  const auto instrument = usb_instrument_of("fault=usb_stall:0.03&seed=4");
  Device device = open_known(instrument);
  const Outcome outcome = run(device, pattern_recipe(kFrames));
  REQUIRE_FALSE(outcome.error.has_value());
  const protocol::Ledger& ledger = outcome.summary.ledger;
  CHECK(ledger.balances());
  CHECK(ledger.exposed == kFrames);
  CHECK(instrument->board().usb()->usb_fault_counts().stalls > 0);
  CHECK(ledger.lost_link > 0);
  CHECK(ledger.lost_link + ledger.delivered == kFrames);
  CHECK(ledger.delivered > 0);
  CHECK(outcome.wrong == 0);
}

TEST_CASE("Commands over USB succeed, each executed once, whatever happens to transfers") {
  for (const std::string_view fault :
       {"usb_short:0.5", "usb_babble:0.1", "usb_stall:0.1", "drop:0.1+duplicate:0.1+usb_babble:0.05"}) {
    INFO(fault);
    Device device = open_known(usb_instrument_of(fmt::format("fault={}&seed=5", fault)));
    for (int i = 0; i < 20; ++i) {
      const std::string name = fmt::format("bench {}", i);
      REQUIRE(device.set_key_value("name", name).has_value());
      const auto value = device.key_value("name");
      REQUIRE(value.has_value());
      CHECK(value->value.str() == name);
    }
  }
}

TEST_CASE("Every fault of frames and transfers together: no hang, no wrong pixel, a ledger that balances") {
  for (int seed = 0; seed < 10; ++seed) {
    INFO(seed);
    const Outcome outcome = run_pattern(
        "drop:0.02+corrupt:0.02+duplicate:0.05+reorder:0.05+truncate:0.02+garbage:0.05+"
        "usb_short:0.1+usb_babble:0.02+usb_stall:0.01",
        40, static_cast<std::uint64_t>(seed));
    REQUIRE_FALSE(outcome.error.has_value());
    CHECK(outcome.summary.ledger.balances());
    CHECK(outcome.summary.ledger.exposed == 40);
    CHECK(outcome.wrong == 0);
  }
}

TEST_CASE("A short stall of the USB link delays and loses nothing") {
  const Outcome outcome = run_pattern("stall:100000:200", 40);
  REQUIRE_FALSE(outcome.error.has_value());
  CHECK(outcome.summary.ledger.delivered == 40);
  CHECK(outcome.wrong == 0);
}

TEST_CASE("A hub that loses power in a stream: the host knows, and after the replug a new session is clean") {
  for (const std::uint64_t position : {20'000ULL, 24'577ULL, 30'000ULL, 40'001ULL, 50'000ULL}) {
    INFO(position);
    const auto instrument = usb_instrument_of(fmt::format("fault=disconnect:{}", position));
    {
      auto device = open_usb(instrument);
      if (device) {
        const Outcome outcome = run(*device, pattern_recipe(40));
        REQUIRE(outcome.error.has_value());
        CHECK(outcome.error->code == ErrorCode::kDisconnected);
        CHECK(outcome.summary.ledger.balances());
        CHECK(outcome.wrong == 0);
      } else {
        CHECK(device.error().code == ErrorCode::kDisconnected);
      }
    }
    CHECK_FALSE(instrument->usb()->present());
    Device again = open_known(instrument);
    CHECK(again.hello().run_state == static_cast<std::uint8_t>(protocol::RunState::kIdle));
    const Outcome outcome = run(again, pattern_recipe(10));
    REQUIRE_FALSE(outcome.error.has_value());
    CHECK(outcome.complete == 10);
    CHECK(outcome.summary.ledger.delivered == 10);
  }
}

TEST_CASE("A device that restarts in a run leaves the bus, joins again, and tells why") {
  protocol::Recipe recipe = pattern_recipe(1);
  recipe.test_pattern = 0;  // The fault counts exposures of the sensor.
  recipe.repeats = 10;
  const auto instrument = usb_instrument_of("fault=reset:4");
  const auto joins = [&] { return instrument->usb()->joins(); };
  {
    Device device = open_known(instrument);
    CHECK(joins() == 1);
    const Outcome outcome = run(device, recipe);
    REQUIRE(outcome.error.has_value());
    CHECK(outcome.error->code == ErrorCode::kDisconnected);
    CHECK(outcome.complete == 3);
    CHECK(outcome.summary.ledger.balances());
    CHECK_FALSE(instrument->usb()->present());
  }
  Device again = open_known(instrument);
  CHECK(joins() == 2);
  CHECK(again.hello().reset_reason == static_cast<std::uint8_t>(protocol::ResetReason::kFault));
  CHECK(run(again, recipe).complete == 10);
}

TEST_CASE("A host that reboots the device over USB finds it on the bus again within a second") {
  const auto instrument = usb_instrument_of("");
  {
    Device device = open_known(instrument);
    REQUIRE(device.reboot().has_value());
    while (device.status()) {
    }
  }
  const std::uint64_t left_at = instrument->now_us();
  Device again = open_known(instrument);
  CHECK(again.hello().reset_reason == static_cast<std::uint8_t>(protocol::ResetReason::kRequested));
  CHECK(instrument->now_us() - left_at < 1'000'000);
}

TEST_CASE("A host that leaves in a run leaves an instrument that the next host finds idle") {
  const auto instrument = usb_instrument_of("");
  {
    Device device = open_known(instrument);
    REQUIRE(device.configure(pattern_recipe(1000)).has_value());
    auto stream = device.start();
    REQUIRE(stream.has_value());
    REQUIRE(stream->next().has_value());
  }
  Device again = open_known(instrument);
  CHECK(again.hello().run_state == static_cast<std::uint8_t>(protocol::RunState::kIdle));
  CHECK(run(again, pattern_recipe(3)).complete == 3);
}

TEST_CASE("calibration=stale over USB: the instrument ages after a calibration, as over sim:") {
  const auto age = [](Device device) {
    const auto before = device.now();
    const auto begun = device.calibration_begin();
    REQUIRE(begun.has_value());
    REQUIRE(device.calibration_step(begun->session, protocol::Target::kDarkCap).has_value());
    REQUIRE(device.calibration_step(begun->session, protocol::Target::kSample).has_value());
    REQUIRE(device.calibration_end(begun->session).has_value());
    REQUIRE(device.status().has_value());
    return device.now() - before;
  };
  const std::string query = "calibration=stale&seed=5";
  auto sim = open_on(instrument_of(query));
  REQUIRE(sim.has_value());
  const auto expected = age(std::move(*sim));
  CHECK(expected > std::chrono::hours(1));
  CHECK(age(open_known(usb_instrument_of(query))) == expected);
}
