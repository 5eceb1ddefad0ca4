// A virtual controller with its firmware's side driven by hand.
#pragma once

#include <catch2/catch.hpp>
#include <string_view>
#include <utility>
#include <vector>

#include "simulator/usb/virtual_usb_controller.h"

namespace scatter::simulator {

using Bytes = std::vector<std::byte>;

inline constexpr std::uint8_t kBulkIn = 0x81;
inline constexpr std::uint8_t kBulkOut = 0x02;
inline constexpr std::uint8_t kReportIn = 0x83;
inline constexpr std::uint8_t kReportOut = 0x04;
inline constexpr std::size_t kPacket = 512;
inline constexpr std::size_t kReport = 64;

/// Bytes that tell their position, from `from` on.
inline Bytes counting(std::size_t size, std::size_t from = 0) {
  Bytes bytes(size);
  for (std::size_t i = 0; i < size; ++i) {
    bytes[i] = static_cast<std::byte>((from + i) * 7 % 251);
  }
  return bytes;
}

struct SettableClock final : firmware::Clock {
  [[nodiscard]] std::uint64_t now_us() noexcept override { return now; }
  std::uint64_t now = 0;
};

/// Plugged in at high speed, joined, reset taken, the four endpoints of the instrument open.
struct SocketRig {
  explicit SocketRig(std::string_view faults = "", std::uint64_t seed = 1)
      : socket(clock, plan(faults), seed) {
    socket.plug(UsbBusSpeed::kHigh);
    socket.connect(true);
    REQUIRE(socket.next_event().kind == firmware::UsbEvent::Kind::kReset);
    open();
  }
  static FaultPlan plan(std::string_view faults) {
    FaultPlan result;
    if (!faults.empty()) {
      REQUIRE(add_faults(faults, result).has_value());
    }
    return result;
  }
  void open() {
    using Type = firmware::UsbEndpoint::Type;
    const std::array<firmware::UsbEndpoint, 4> endpoints{{
        {.address = kBulkIn, .type = Type::kBulk, .packet_bytes = kPacket},
        {.address = kBulkOut, .type = Type::kBulk, .packet_bytes = kPacket},
        {.address = kReportIn, .type = Type::kInterrupt, .packet_bytes = kReport},
        {.address = kReportOut, .type = Type::kInterrupt, .packet_bytes = kReport},
    }};
    socket.open_endpoints(endpoints);
  }
  /// One transfer of the device.
  void send(const Bytes& bytes, std::uint8_t endpoint = kBulkIn) {
    REQUIRE(socket.write(endpoint, bytes) == bytes.size());
    socket.end_transfer(endpoint);
  }
  std::uint64_t ask(std::size_t length, std::uint8_t endpoint = kBulkIn) {
    socket.submit({.id = ++last_id, .endpoint = endpoint, .length = length});
    return last_id;
  }
  std::uint64_t give(Bytes bytes, std::uint8_t endpoint = kBulkOut) {
    socket.submit({.id = ++last_id, .endpoint = endpoint, .data = std::move(bytes)});
    return last_id;
  }
  /// The next completion, which must be of this transfer and have this outcome; its bytes.
  Bytes expect(std::uint64_t id, UsbOutcome outcome = UsbOutcome::kDone) {
    auto completion = socket.next_completion();
    REQUIRE(completion.has_value());
    CHECK(completion->id == id);
    CHECK(completion->outcome == outcome);
    CHECK((completion->data.empty() || completion->actual == completion->data.size()));
    last_actual = completion->actual;
    return std::move(completion->data);
  }
  bool quiet() { return !socket.next_completion().has_value(); }
  Bytes device_takes(std::size_t most, std::uint8_t endpoint = kBulkOut) {
    Bytes out(most);
    out.resize(socket.read(endpoint, out));
    return out;
  }

  SettableClock clock;
  VirtualUsbController socket;
  std::uint64_t last_id = 0;
  std::size_t last_actual = 0;
};

}  // namespace scatter::simulator
