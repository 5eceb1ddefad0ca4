// The host controller above one socket: transfers with callbacks, and the control requests of enumeration.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "simulator/instrument/virtual_clock.h"
#include "simulator/usb/usb_port.h"

namespace scatter::mock_bus {

/// What is plugged in: a virtual instrument, or a stranger.
class Peripheral {
 public:
  virtual ~Peripheral() = default;
  [[nodiscard]] virtual simulator::UsbPort& port() = 0;
  /// As VirtualInstrument's.
  virtual std::uint64_t run_ready() = 0;
  [[nodiscard]] virtual std::uint64_t now_us() const = 0;
  virtual void advance_to(std::uint64_t time_us) = 0;
  [[nodiscard]] virtual simulator::ClockMode clock_mode() const = 0;
  virtual void press_button() {}
};

using Bytes = std::vector<std::byte>;

/// What a host learns when it enumerates a device.
struct Enumerated {
  Bytes device;         ///< Device descriptor.
  Bytes configuration;  ///< Configuration descriptor with all that belongs to it.
  std::string manufacturer;
  std::string product;
  std::string serial;

  struct Interface {
    std::uint8_t number = 0;
    std::uint8_t setting = 0;
    std::uint8_t klass = 0;
    std::uint8_t subclass = 0;
    std::uint8_t protocol = 0;
    std::vector<std::uint8_t> endpoints;
    std::uint16_t report_descriptor_bytes = 0;  ///< HID only.
  };
  std::vector<Interface> interfaces;  ///< One for each alternate setting.

  [[nodiscard]] std::uint16_t vendor() const { return word(8); }
  [[nodiscard]] std::uint16_t product_id() const { return word(10); }
  [[nodiscard]] std::uint16_t release() const { return word(12); }

 private:
  [[nodiscard]] std::uint16_t word(std::size_t at) const {
    return static_cast<std::uint16_t>(std::to_integer<unsigned>(device.at(at)) |
                                      std::to_integer<unsigned>(device.at(at + 1)) << 8U);
  }
};

using Setup = std::array<std::uint8_t, 8>;
[[nodiscard]] Setup setup_packet(std::uint8_t type, std::uint8_t request, std::uint16_t value,
                                 std::uint16_t index, std::uint16_t length);

class HostPort {
 public:
  using Done = std::function<void(simulator::UsbCompletion&)>;

  explicit HostPort(Peripheral& peripheral) : peripheral_(peripheral) {}

  /// `done` is called once, from dispatch().
  std::uint64_t submit(simulator::UsbTransfer transfer, Done done);
  bool cancel(std::uint64_t id);
  /// Calls what is due. True when something was.
  bool dispatch();
  /// Runs the device until it has answered, at most two seconds of its time. Nothing: refused, or no answer.
  [[nodiscard]] std::optional<Bytes> control(const Setup& setup, Bytes data = {});

  /// Address, descriptors, strings, configuration 1. Nothing: the device does not play along.
  [[nodiscard]] std::optional<Enumerated> enumerate(std::uint8_t address);
  [[nodiscard]] Peripheral& peripheral() noexcept { return peripheral_; }

  /// It no longer answers: nothing runs it any more.
  bool hung = false;
  /// It has no power, and nobody has noticed yet: transfers fail.
  bool powerless = false;

 private:
  void finish(simulator::UsbCompletion& completion);
  [[nodiscard]] std::string string_descriptor(std::uint8_t index);

  Peripheral& peripheral_;
  std::uint64_t next_id_ = 1;
  std::map<std::uint64_t, Done> under_way_;
  std::vector<std::uint64_t> failing_;  ///< Submitted without power.
};

}  // namespace scatter::mock_bus
