// The rescue channel over real hidapi, while frames stream and while nothing else gets through. Built once
// for each backend: hidraw and libusb.
#include "host_sdk/device/usb/rescue_channel.h"

#include <sys/resource.h>

#include "tests/usb/child.h"
#include "tests/usb/rig.h"

using namespace scatter;
using namespace scatter::usb_test;
using device::Device;
using device::usb::RescueChannel;
using integration::pattern_recipe;

namespace {

RescueChannel open_rescue() {
  Result<RescueChannel> channel = RescueChannel::open("");
  if (!channel) {
    FAIL(channel.error().what);
  }
  return std::move(*channel);
}

}  // namespace

TEST_CASE("The status is that of the instrument") {
  Host host;
  RescueChannel channel = open_rescue();
  const auto idle = channel.status();
  REQUIRE(idle.has_value());
  CHECK(idle->run_state == static_cast<std::uint8_t>(protocol::RunState::kIdle));
  CHECK_FALSE(idle->session_open);
  CHECK(idle->boot_count >= 1);
  Device device = host.open();
  const auto open = channel.status();
  REQUIRE(open.has_value());
  CHECK(open->session_open);
  CHECK(open->boot_count == idle->boot_count);
}

TEST_CASE(
    "The first status of a new channel is that of now, although an older report waits in the instrument") {
  Host host;
  for (int k = 0; k < 20; ++k) {
    INFO("round " << k);
    // Told of nobody's session while nobody reads: the report waits.
    Device device = host.open();
    auto stream = start_stream(device, endless_recipe());
    REQUIRE(stream.next().has_value());
    RescueChannel channel = open_rescue();
    const auto status = channel.status();
    REQUIRE(status.has_value());
    CHECK(status->session_open);
    CHECK(status->run_state != static_cast<std::uint8_t>(protocol::RunState::kIdle));
    CHECK(status->exposed > 0);
    REQUIRE(stream.abort().has_value());
  }
}

TEST_CASE("Beside a stream in the same program the status comes, and the stream loses nothing") {
  Host host;
  Device device = host.open();
  integration::Outcome outcome;
  std::jthread stream([&] { outcome = integration::run(device, pattern_recipe(500)); });
  RescueChannel channel = open_rescue();
  for (int k = 0; k < 50; ++k) {
    REQUIRE(channel.status().has_value());
  }
  stream.join();
  check_whole(outcome, 500);
}

TEST_CASE("abort() ends the run of another program, which sees it end as aborted") {
  Host host;
  Device device = host.open();
  auto stream = start_stream(device, endless_recipe());
  REQUIRE(stream.next().has_value());
  RescueChannel channel = open_rescue();
  REQUIRE(channel.abort().has_value());
  for (;;) {
    const auto frame = stream.next();
    REQUIRE(frame.has_value());
    if (!*frame) {
      break;
    }
  }
  CHECK(stream.summary().reason == protocol::RunEnd::kAborted);
  CHECK(stream.summary().ledger.balances());
  check_whole(integration::run(device, pattern_recipe(3)), 3);
}

TEST_CASE("While the bulk pipes are stuck for want of a reader, status and abort get through") {
  Host host;
  Device device = host.open();
  auto stream = start_stream(device, endless_recipe(), 64);
  REQUIRE(stream.next().has_value());
  std::this_thread::sleep_for(std::chrono::milliseconds(100));  // All transfers are full, nobody takes them.
  RescueChannel channel = open_rescue();
  const Clock::time_point begin = Clock::now();
  REQUIRE(channel.status().has_value());
  REQUIRE(channel.abort().has_value());
  CHECK(ms_since(begin) < 1000);
  for (;;) {
    const auto frame = stream.next();
    REQUIRE(frame.has_value());
    if (!*frame) {
      break;
    }
  }
  CHECK(stream.summary().ledger.balances());
}

TEST_CASE("The measure button wakes who waits for it, and nobody else") {
  Host host;
  RescueChannel channel = open_rescue();
  const device::Wait brief{.timeout = std::chrono::milliseconds(100)};
  const auto untouched = channel.wait_for_button(brief);
  REQUIRE_FALSE(untouched.has_value());
  CHECK(untouched.error().code == ErrorCode::kDeadlineExceeded);
  std::jthread finger([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    host.bus().press_button();
  });
  const Clock::time_point begin = Clock::now();
  CHECK(channel.wait_for_button({}).has_value());
  CHECK(ms_since(begin) < 500);
}

TEST_CASE("reboot() restarts the instrument, and the reason is known afterwards") {
  Host host;
  std::uint32_t boots = 0;
  {
    RescueChannel channel = open_rescue();
    const auto before = channel.status();
    REQUIRE(before.has_value());
    boots = before->boot_count;
    REQUIRE(channel.reboot().has_value());
  }
  Device device = host.open_soon();
  CHECK(device.hello().boot_count == boots + 1);
}

TEST_CASE("The fault record of an instrument that never crashed is empty") {
  Host host;
  RescueChannel channel = open_rescue();
  const auto record = channel.fault_record();
  REQUIRE(record.has_value());
  CHECK(record->present == 0);
}

TEST_CASE("Unplugged: the call under way says so within 300 ms, and a new channel works after plugging in") {
  Host host;
  {
    RescueChannel channel = open_rescue();
    std::jthread hand([&] {
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
      host.bus().unplug();
    });
    const Clock::time_point begin = Clock::now();
    const auto pressed = channel.wait_for_button({});
    REQUIRE_FALSE(pressed.has_value());
    CHECK(pressed.error().code == ErrorCode::kDisconnected);
    CHECK(ms_since(begin) < 350);
    const auto none = RescueChannel::open("");
    REQUIRE_FALSE(none.has_value());
    CHECK(none.error().code == ErrorCode::kNotFound);
  }
  host.bus().plug();
  CHECK(open_rescue().status().has_value());
}

TEST_CASE("A stop request ends a wait within 20 ms") {
  Host host;
  RescueChannel channel = open_rescue();
  std::stop_source source;
  Clock::time_point asked;
  std::jthread other([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    asked = Clock::now();
    source.request_stop();
  });
  const auto pressed =
      channel.wait_for_button({.timeout = std::chrono::seconds(4), .stop = source.get_token()});
  const Clock::time_point ended = Clock::now();
  other.join();
  REQUIRE_FALSE(pressed.has_value());
  CHECK(pressed.error().code == ErrorCode::kAborted);
  CHECK(Milliseconds(ended - asked).count() < 40);  // 20 ms, and a scheduler's slice on a busy machine.
}

TEST_CASE("No permission: the udev rule is named with the command that installs it") {
  Host host;
  host.allow_warnings();
  host.bus().set_access(false);
  const auto channel = RescueChannel::open("");
  REQUIRE_FALSE(channel.has_value());
  CHECK(channel.error().code == ErrorCode::kPermissionDenied);
  CHECK(channel.error().remedy.find("udev") != std::string::npos);
  host.bus().set_access(true);
}
