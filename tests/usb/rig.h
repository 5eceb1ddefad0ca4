// What the tests under mock_bus share: the host's side of the bus, watched for complaints of libusb.
#pragma once

#include <catch2/catch.hpp>
#include <chrono>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <thread>
#include <vector>

#include "host_sdk/device/device.h"
#include "host_sdk/device/usb/context.h"
#include "tests/integration/rig.h"
#include "tests/usb/bus_control.h"

namespace scatter::usb_test {

using Clock = std::chrono::steady_clock;
using Milliseconds = std::chrono::duration<double, std::milli>;

/// What libusb has said at level warning or error since the last call, in this program.
[[nodiscard]] std::vector<std::string> take_usb_warnings();

[[nodiscard]] inline double ms_since(Clock::time_point start) {
  return Milliseconds(Clock::now() - start).count();
}

/// Waits until `condition` holds; false after two seconds.
template <typename Condition>
[[nodiscard]] bool soon(Condition&& condition, std::chrono::milliseconds limit = std::chrono::seconds(2)) {
  const Clock::time_point end = Clock::now() + limit;
  while (!condition()) {
    if (Clock::now() > end) {
      return false;
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  return true;
}

/// One program's USB, and the mock below it. At its end the bus must be as it was found: nothing under way,
/// nothing that libusb found strange. Sockets other than the first are a test's own to unplug.
class Host {
 public:
  Host();
  ~Host();
  Host(const Host&) = delete;
  Host& operator=(const Host&) = delete;

  [[nodiscard]] BusControl& bus() { return bus_; }
  [[nodiscard]] device::usb::Context& context() { return *context_; }
  [[nodiscard]] const device::TransportRegistry& registry() const { return registry_; }
  /// Everything that was opened lives on.
  void destroy_context() { context_.reset(); }
  /// libusb may complain in this test (a device that sends garbage, for example).
  void allow_warnings() { warnings_allowed_ = true; }

  [[nodiscard]] Result<device::Device> try_open(const std::string& uri = "usb:",
                                                const device::Wait& wait = {}) const;
  [[nodiscard]] device::Device open(const std::string& uri = "usb:") const;
  /// Opens it as soon as it is there; fails the test after two seconds.
  [[nodiscard]] device::Device open_soon(const std::string& uri = "usb:") const;

 private:
  BusControl bus_;
  std::optional<device::usb::Context> context_;
  device::TransportRegistry registry_;
  bool warnings_allowed_ = false;
};

/// The figure that at least 99 % of the samples do not exceed.
[[nodiscard]] double p99(std::vector<double> samples);

/// Frames of the counter pattern that are all right, and a ledger that says so.
void check_whole(const integration::Outcome& outcome, std::uint16_t frames);

/// Configured and running.
[[nodiscard]] device::Stream start_stream(device::Device& device, const protocol::Recipe& recipe,
                                          std::uint32_t credit = 8);

/// 64 x 64 pixels of pattern for ever (65535 repeats), 1 ms each.
[[nodiscard]] protocol::Recipe endless_recipe();

}  // namespace scatter::usb_test
