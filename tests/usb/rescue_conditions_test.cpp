// PROVES: issue 6: HID from one thread; several instruments, busy device, foreign device, device that never
// answers, HID missing: clear error, remedy, bounded time. Beside rescue_test.cpp; built once for each
// backend of hidapi.
#include "host_sdk/device/usb/rescue_channel.h"

#include <atomic>
#include <catch2/catch.hpp>
#include <chrono>
#include <future>
#include <thread>
#include <vector>

#include "host_sdk/device/usb/bus_scan.h"
#include "tests/usb/bus_control.h"

using namespace scatter::device;
using scatter::ErrorCode;
using scatter::Result;
using scatter::Status;
using scatter::usb_test::BusControl;
using usb::RescueChannel;
using Clock = std::chrono::steady_clock;
using std::chrono::milliseconds;

namespace {

#ifdef SCATTER_HIDAPI_LIBUSB
constexpr bool kNeedsKernelDriver = false;
#else
constexpr bool kNeedsKernelDriver = true;
#endif

/// Far above what a quiet computer needs; a call that hangs is over it.
constexpr milliseconds kBounded{3000};

RescueChannel opened(std::string_view serial = "") {
  auto channel = RescueChannel::open(serial);
  INFO((channel ? "" : channel.error().what));
  REQUIRE(channel);
  return std::move(*channel);
}

/// After a restart or a replug the instrument needs a moment to be on the bus again.
RescueChannel opened_again(std::string_view serial = "") {
  const auto until = Clock::now() + kBounded;
  while (true) {
    auto channel = RescueChannel::open(serial);
    if (channel) {
      return std::move(*channel);
    }
    INFO(channel.error().what);
    REQUIRE(Clock::now() < until);
    std::this_thread::sleep_for(milliseconds(10));
  }
}

std::string serial_in(std::size_t place) {
  const auto entries = usb::scan_bus();
  REQUIRE(entries.size() > place);
  return entries[place].serial;
}

template <typename T>
ErrorCode code_of(const T& result) {
  REQUIRE_FALSE(result);
  INFO(result.error().what);
  CHECK_FALSE(result.error().remedy.empty());
  return result.error().code;
}

/// Leaves the bus as the next test expects it.
struct Bus : BusControl {
  ~Bus() {
    try {
      set_access(true);
      set_hid_driver(true);
      plug();
    } catch (const std::exception& error) {
      FAIL_CHECK(error.what());
    }
  }
};

}  // namespace

TEST_CASE("Reboot restarts the instrument; the channel is over and a new one opens") {
  auto channel = opened();
  const auto before = channel.status();
  REQUIRE(before);
  REQUIRE(channel.reboot());
  const auto until = Clock::now() + kBounded;
  while (channel.status({.timeout = milliseconds(100)})) {
    REQUIRE(Clock::now() < until);
  }
  auto again = opened_again();
  const auto after = again.status();
  REQUIRE(after);
  CHECK(after->boot_count == before->boot_count + 1);
}

TEST_CASE("A press of the measure button ends the wait for it, one that came before does not") {
  Bus bus;
  auto channel = opened();
  bus.press_button();
  const auto before = channel.status();
  REQUIRE(before);
  CHECK(code_of(channel.wait_for_button({.timeout = milliseconds(100)})) == ErrorCode::kDeadlineExceeded);
  auto waiting =
      std::async(std::launch::async, [&] { return channel.wait_for_button({.timeout = kBounded}); });
  // Presses until one falls into the wait: the wait may not have begun at the first.
  while (waiting.wait_for(milliseconds(20)) == std::future_status::timeout) {
    bus.press_button();
  }
  CHECK(waiting.get());
  const auto after = channel.status();
  REQUIRE(after);
  CHECK(after->button_presses > before->button_presses);
}

TEST_CASE("Unplugging ends a wait as disconnected; after plugging in a new channel opens") {
  Bus bus;
  {
    auto channel = opened();
    auto waiting = std::async(std::launch::async,
                              [&] { return channel.wait_for_button({.timeout = std::chrono::hours(1)}); });
    std::this_thread::sleep_for(milliseconds(50));
    bus.unplug();
    CHECK(code_of(waiting.get()) == ErrorCode::kDisconnected);
    CHECK(code_of(channel.status()) == ErrorCode::kDisconnected);
    CHECK(code_of(channel.abort()) == ErrorCode::kDisconnected);
    CHECK(code_of(RescueChannel::open("")) == ErrorCode::kNotFound);
  }
  bus.plug();
  CHECK(opened_again().status());
}

TEST_CASE("Whenever it is unplugged, the next call of each kind says that it is gone, not that it is deaf") {
  Bus bus;
  for (int k = 0; k < 30; ++k) {
    INFO("round " << k);
    {
      auto channel = opened_again();
      REQUIRE(channel.status());
      bus.unplug();
      switch (k % 3) {
        case 0:
          CHECK(code_of(channel.status()) == ErrorCode::kDisconnected);
          break;
        case 1:
          CHECK(code_of(channel.abort()) == ErrorCode::kDisconnected);
          break;
        default:
          CHECK(code_of(channel.fault_record()) == ErrorCode::kDisconnected);
      }
    }
    bus.plug();
  }
}

TEST_CASE("An instrument that answers nothing costs no caller more than its deadline") {
  Bus bus;
  auto channel = opened();
  bus.hang();
  const auto start = Clock::now();
  CHECK(code_of(channel.abort({.timeout = milliseconds(200)})) == ErrorCode::kDeadlineExceeded);
  CHECK(Clock::now() - start < kBounded);
}

TEST_CASE("Without the kernel's HID driver the channel says what is missing, or does without it") {
  Bus bus;
  bus.unplug();
  bus.set_hid_driver(false);
  bus.plug();
  if (kNeedsKernelDriver) {
    const auto missing = RescueChannel::open("");
    CHECK(code_of(missing) == ErrorCode::kNotFound);
    CHECK(missing.error().remedy.find("usbhid") != std::string::npos);
  } else {
    CHECK(opened_again().status());
  }
  bus.unplug();
}

TEST_CASE("Of several instruments the named one is opened") {
  Bus bus;
  static const int kSecond = bus.add_instrument("seed=8");
  bus.plug(kSecond);
  const std::vector<std::string> serials = {serial_in(0), serial_in(1)};
  REQUIRE(serials[0] != serials[1]);
  const auto unnamed = RescueChannel::open("");
  CHECK(code_of(unnamed) == ErrorCode::kInvalidArgument);
  for (const auto& serial : serials) {
    CHECK(unnamed.error().what.find(serial) != std::string::npos);
  }
  CHECK(code_of(RescueChannel::open("nobody")) == ErrorCode::kNotFound);
  auto first = opened(serials[0]);
  auto second = opened(serials[1]);
  const auto before = first.status();
  const auto beside = second.status();
  REQUIRE(before);
  REQUIRE(beside);
  bus.press_button(kSecond);
  const auto until = Clock::now() + kBounded;
  while (second.status()->button_presses == beside->button_presses) {
    REQUIRE(Clock::now() < until);
  }
  CHECK(first.status()->button_presses == before->button_presses);
  CHECK(code_of(RescueChannel::open_at("9-9")) == ErrorCode::kNotFound);
  bus.unplug(kSecond);
  CHECK(code_of(second.status()) == ErrorCode::kDisconnected);
  CHECK(first.status());
}

TEST_CASE("A stranger's device with our numbers is not taken for an instrument") {
  Bus bus;
  static const int kStranger = bus.add_stranger();
  bus.plug(kStranger);
  CHECK(opened().status());
  bus.unplug();
  CHECK(code_of(RescueChannel::open("")) == ErrorCode::kFailedPrecondition);
  bus.unplug(kStranger);
}

TEST_CASE("Many threads ask at the same time and each gets its own answer") {
  auto channel = opened();
  std::atomic<int> good = 0;
  std::vector<std::thread> threads;
  for (int t = 0; t < 4; ++t) {
    threads.emplace_back([&, t] {
      for (int i = 0; i < 25; ++i) {
        const bool asked = t % 2 == 0 ? channel.status().has_value() : channel.fault_record().has_value();
        good += asked ? 1 : 0;
      }
    });
  }
  for (auto& thread : threads) {
    thread.join();
  }
  CHECK(good == 100);
}

TEST_CASE("A second channel to one instrument works, or is told that the first holds it") {
  auto first = opened();
  auto second = RescueChannel::open("");
  if (!kNeedsKernelDriver) {
    CHECK(code_of(second) == ErrorCode::kBusy);
    CHECK(first.fault_record());
    return;
  }
  REQUIRE(second);
  for (int i = 0; i < 20; ++i) {
    CHECK(first.fault_record());
    CHECK(second->fault_record());
  }
}

TEST_CASE("A hundred channels one after the other leave nothing behind") {
  for (int i = 0; i < 100; ++i) {
    CHECK(opened().status());
  }
}
