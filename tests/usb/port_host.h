// A host in this process on the virtual USB socket: what a kernel's USB core does, without a kernel.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "simulator/instrument/virtual_instrument.h"
#include "simulator/usb/usb_port.h"

namespace scatter::usb_test {

using Bytes = std::vector<std::byte>;

/// A control request as on the bus.
struct Request {
  std::uint8_t type = 0;  ///< bmRequestType; bit 7: data goes to the host.
  std::uint8_t request = 0;
  std::uint16_t value = 0;
  std::uint16_t index = 0;
};

/// Lets the instrument run while it waits: time passes only there, and only for a virtual clock; on a real
/// one it sleeps. Every wait ends. Threads: one.
class PortHost {
 public:
  static constexpr std::uint64_t kPatienceUs = 5'000'000;

  /// `instrument` has Carrier::kUsb. Nothing is plugged yet.
  explicit PortHost(std::shared_ptr<simulator::VirtualInstrument> instrument);

  /// Plugs the cable where it is not in, and waits until the device is on the bus. False: it does not come.
  [[nodiscard]] bool plug(simulator::UsbBusSpeed speed = simulator::UsbBusSpeed::kHigh);
  /// Reset, address, descriptors, configuration 1. False: the device left, or refused something.
  [[nodiscard]] bool enumerate();
  /// plug() and enumerate(), then alternate setting 1 of the stream interface.
  [[nodiscard]] bool open_stream();
  /// Selects an alternate setting of the stream interface.
  [[nodiscard]] bool select_stream(std::uint8_t setting);

  /// Nothing: the device is gone, or did not answer in time (then the request is cancelled).
  [[nodiscard]] std::optional<simulator::UsbCompletion> control(const Request& request, std::uint16_t length,
                                                                Bytes data = {});
  /// The data stage of a request that succeeded; empty when it did not.
  [[nodiscard]] Bytes control_in(const Request& request, std::uint16_t length);
  [[nodiscard]] bool control_out(const Request& request, Bytes data = {});
  [[nodiscard]] Bytes descriptor(std::uint8_t type, std::uint8_t index, std::uint16_t length,
                                 std::uint16_t language = 0);
  [[nodiscard]] bool clear_halt(std::uint8_t endpoint);

  /// Starts a transfer; its completion is kept until it is asked for.
  std::uint64_t submit_in(std::uint8_t endpoint, std::size_t length, Bytes memory = {});
  std::uint64_t submit_out(std::uint8_t endpoint, Bytes data);
  /// Waits for a completion; nothing after `patience_us`: the transfer is still under way.
  [[nodiscard]] std::optional<simulator::UsbCompletion> wait_for(std::uint64_t id,
                                                                 std::uint64_t patience_us = kPatienceUs);
  /// The same without waiting.
  [[nodiscard]] std::optional<simulator::UsbCompletion> take(std::uint64_t id);
  void cancel(std::uint64_t id);

  /// Runs the instrument up to the next thing that happens, at most until `until_us` (instrument's time).
  /// False: that time has come and nothing more happens now.
  bool run(std::uint64_t until_us);
  /// Runs it for so long.
  void run_for(std::uint64_t duration_us);

  [[nodiscard]] simulator::VirtualInstrument& instrument() noexcept { return *instrument_; }
  [[nodiscard]] simulator::UsbPort& port() noexcept { return port_; }
  /// The device descriptor and the configuration descriptor of the last enumerate().
  [[nodiscard]] const Bytes& device_descriptor() const noexcept { return device_descriptor_; }
  [[nodiscard]] const Bytes& configuration() const noexcept { return configuration_; }

 private:
  void collect();

  std::shared_ptr<simulator::VirtualInstrument> instrument_;
  simulator::UsbPort& port_;
  std::uint64_t next_id_ = 1;
  std::map<std::uint64_t, simulator::UsbCompletion> finished_;
  Bytes device_descriptor_;
  Bytes configuration_;
};

}  // namespace scatter::usb_test
