// PROVES: Linux, Documentation/usb/usbip_protocol.rst, USBIP_RET_SUBMIT and USBIP_RET_UNLINK: status.
#include "simulator/usbip/exported_device.h"

#include <cerrno>
#include <string>
#include <utility>
#include <vector>

#include <catch2/catch.hpp>

#include "tests/unit/simulator_usbip/scripted_port.h"

namespace {

using namespace scatter::simulator;
using namespace scatter::simulator::usbip;

constexpr std::uint32_t kId = 0x10002;

std::int32_t field(const Reply& reply, std::size_t at) {
  std::uint32_t value = 0;
  for (std::size_t k = 0; k < 4; ++k) {
    value = value << 8U | std::to_integer<std::uint32_t>(reply.header[at + k]);
  }
  return static_cast<std::int32_t>(value);
}

/// A reply in words: command, sequence, status, bytes.
struct Said {
  int command = 0;
  int sequence = 0;
  int status = 0;
  int actual = 0;
  std::size_t data = 0;
  bool operator==(const Said&) const = default;
};
std::ostream& operator<<(std::ostream& out, const Said& said) {
  return out << (said.command == 3 ? "RET_SUBMIT " : "RET_UNLINK ") << said.sequence << " status "
             << said.status << " actual " << said.actual << " data " << said.data;
}
constexpr int kRetSubmit = 3;
constexpr int kRetUnlink = 4;

struct Held {
  Held() {
    settle();
    REQUIRE(device.record() != nullptr);
    REQUIRE(device.import("1-1") == OpStatus::kOk);
  }
  void settle() {
    do {
      port.enumerate();
    } while (device.poll());
  }
  void submit(std::uint32_t sequence, std::uint8_t endpoint, std::size_t length, bool short_not_ok = false) {
    CHECK(device.submit({.sequence = sequence,
                         .device = kId,
                         .endpoint = endpoint,
                         .short_not_ok = short_not_ok,
                         .length = length,
                         .data = std::vector<std::byte>((endpoint & 0x80U) != 0 ? 0 : length)}) == "");
  }
  void control(std::uint32_t sequence, std::array<std::uint8_t, 8> setup) {
    CHECK(device.submit({.sequence = sequence, .device = kId, .setup = setup, .data = {}}) == "");
  }
  void unlink(std::uint32_t sequence, std::uint32_t victim) {
    CHECK(device.unlink({.sequence = sequence, .device = kId, .victim = victim}) == "");
  }
  /// The port's id of the holder's transfer.
  std::uint64_t id(std::uint32_t sequence) const {
    for (const UsbTransfer& each : port.transfers) {
      if (static_cast<std::uint32_t>(each.id) == sequence && each.id >> 32U != 0) {
        return each.id;
      }
    }
    return 0;
  }
  std::vector<Said> said() {
    device.poll();
    std::vector<Said> all;
    while (const auto reply = device.next_reply()) {
      const bool submit = field(*reply, 0) == kRetSubmit;
      all.push_back({field(*reply, 0), field(*reply, 4), field(*reply, 20), submit ? field(*reply, 24) : 0,
                     reply->data.size()});
    }
    return all;
  }

  ScriptedPort port;
  ExportedDevice device{port, UsbBusSpeed::kHigh};
};

TEST_CASE("The device on the bus has an address and a name before anybody imports it") {
  ScriptedPort port;
  ExportedDevice device(port, UsbBusSpeed::kFull);
  CHECK(device.record() == nullptr);
  CHECK(device.import("1-1") == OpStatus::kNotAvailable);
  device.poll();
  REQUIRE(port.transfers.size() == 3);
  CHECK(port.transfers[0].setup == std::array<std::uint8_t, 8>{0, 5, 2, 0, 0, 0, 0, 0});  // SET_ADDRESS 2
  port.enumerate();
  device.poll();
  REQUIRE(device.record() != nullptr);
  CHECK(device.record()->bus_id == "1-1");
  CHECK(device.record()->id() == kId);
  CHECK(device.record()->product == 0x000D);
  CHECK(device.record()->speed == Speed::kFull);
}

TEST_CASE("A device that answers nonsense is refused as faulty") {
  ScriptedPort port;
  port.configuration_descriptor.resize(5);
  ExportedDevice device(port, UsbBusSpeed::kHigh);
  for (int k = 0; k < 10; ++k) {
    device.poll();
    port.enumerate();
  }
  CHECK(device.import("1-1") == OpStatus::kDeviceError);
  CHECK(port.transfers.empty());  // Nobody asks for ever.
}

TEST_CASE("One holder at a time; the next one finds a device that was reset") {
  Held held;
  CHECK(held.device.import("1-1") == OpStatus::kBusy);
  CHECK(held.device.import("1-2") == OpStatus::kNoDevice);
  CHECK(held.port.resets == 0);
  held.submit(1, 0x81, 512);
  held.device.release();
  CHECK(held.port.resets == 1);
  held.settle();
  CHECK(held.device.import("1-1") == OpStatus::kOk);
  CHECK(held.said().empty());  // Nothing of the first holder's.
}

TEST_CASE("Transfers end with the status that Linux expects of each outcome") {
  const auto [outcome, status] = GENERATE(table<UsbOutcome, int>({{UsbOutcome::kDone, 0},
                                                                  {UsbOutcome::kStalled, -EPIPE},
                                                                  {UsbOutcome::kBabble, -EOVERFLOW},
                                                                  {UsbOutcome::kError, -EPROTO},
                                                                  {UsbOutcome::kGone, -ESHUTDOWN}}));
  Held held;
  held.submit(7, 0x81, 512);
  held.port.complete(held.id(7), outcome);
  CHECK(held.said() == std::vector<Said>{{kRetSubmit, 7, status, 0, 0}});
}

TEST_CASE("What is complete is replied to without a turn of the device in between") {
  Held held;
  held.submit(1, 0x81, 512);
  held.port.complete(held.id(1), UsbOutcome::kDone, std::vector<std::byte>(100));
  const auto reply = held.device.next_reply();
  REQUIRE(reply.has_value());
  CHECK(field(*reply, 4) == 1);
  CHECK(reply->data.size() == 100);
}

TEST_CASE("A short transfer is an error only where the host said so") {
  Held held;
  held.submit(1, 0x81, 512, false);
  held.submit(2, 0x81, 512, true);
  held.submit(3, 0x81, 100, true);
  for (const std::uint32_t k : {1U, 2U, 3U}) {
    held.port.complete(held.id(k), UsbOutcome::kDone, std::vector<std::byte>(100));
  }
  CHECK(held.said() == std::vector<Said>{{kRetSubmit, 1, 0, 100, 100},
                                         {kRetSubmit, 2, -EREMOTEIO, 100, 100},
                                         {kRetSubmit, 3, 0, 100, 100}});
}

TEST_CASE("A transfer to the device says how much was taken and brings no data back") {
  Held held;
  held.submit(1, 0x02, 300);
  held.port.complete(held.id(1), UsbOutcome::kDone);
  CHECK(held.said() == std::vector<Said>{{kRetSubmit, 1, 0, 300, 0}});
}

TEST_CASE("Unlinking a waiting transfer gives RET_UNLINK with ECONNRESET and no RET_SUBMIT") {
  Held held;
  held.submit(1, 0x81, 512);
  held.unlink(2, 1);
  CHECK(held.said() == std::vector<Said>{{kRetUnlink, 2, -ECONNRESET, 0, 0}});
  CHECK(held.port.transfers.empty());
}

TEST_CASE("Unlinking a transfer that was completed gives RET_SUBMIT first, then RET_UNLINK with 0") {
  Held held;
  held.submit(1, 0x81, 512);
  held.port.complete(held.id(1), UsbOutcome::kDone, std::vector<std::byte>(5));
  held.unlink(2, 1);
  CHECK(held.said() == std::vector<Said>{{kRetSubmit, 1, 0, 5, 5}, {kRetUnlink, 2, 0, 0, 0}});
}

TEST_CASE("Unlinking a transfer that moved some bytes loses none of them") {
  Held held;
  held.submit(1, 0x81, 2048);
  held.port.moved_before_cancel = 512;
  held.unlink(2, 1);
  CHECK(held.said() == std::vector<Said>{{kRetSubmit, 1, -ECONNRESET, 512, 512}, {kRetUnlink, 2, 0, 0, 0}});
}

TEST_CASE("Unlinking what was replied to, or never was, gives RET_UNLINK with 0") {
  Held held;
  held.submit(1, 0x81, 512);
  held.port.complete(held.id(1), UsbOutcome::kDone);
  CHECK(held.said().size() == 1);
  held.unlink(2, 1);
  held.unlink(3, 99);
  CHECK(held.said() == std::vector<Said>{{kRetUnlink, 2, 0, 0, 0}, {kRetUnlink, 3, 0, 0, 0}});
}

TEST_CASE("A number under way twice, a second unlink or a foreign device id end the connection") {
  Held held;
  held.submit(1, 0x81, 512);
  CHECK(held.device.submit({.sequence = 1, .device = kId, .endpoint = 0x81, .data = {}}) != "");
  CHECK(held.device.submit({.sequence = 2, .device = 0x10003, .endpoint = 0x81, .data = {}}) != "");
}

TEST_CASE("A control request whose buffer is not what it asks for is refused") {
  Held held;
  CHECK(held.device.submit({.sequence = 1,
                            .device = kId,
                            .endpoint = 0x80,
                            .length = 8,
                            .setup = {0x80, 6, 0, 1, 0, 0, 18, 0},
                            .data = {}}) == "");
  CHECK(held.said() == std::vector<Said>{{kRetSubmit, 1, -EINVAL, 0, 0}});
  CHECK(held.port.transfers.empty());
}

TEST_CASE("No more transfers and bytes are under way than the server has room for") {
  Held held;
  const auto most = static_cast<std::uint32_t>(ExportedDevice::kMostUnderWay);
  for (std::uint32_t k = 0; k < most; ++k) {
    held.submit(k, 0x81, 1);
  }
  held.submit(most, 0x81, 1);
  CHECK(held.said() == std::vector<Said>{{kRetSubmit, static_cast<int>(most), -ENOMEM, 0, 0}});
  Held other;
  const auto whole = static_cast<std::uint32_t>(ExportedDevice::kMostBytesUnderWay / kMostTransferBytes);
  for (std::uint32_t k = 0; k < whole; ++k) {
    other.submit(k, 0x81, kMostTransferBytes);
  }
  other.submit(whole, 0x81, 1);
  CHECK(other.said() == std::vector<Said>{{kRetSubmit, static_cast<int>(whole), -ENOMEM, 0, 0}});
  // What has ended makes room.
  other.port.complete(other.id(0), UsbOutcome::kDone);
  CHECK(other.said().size() == 1);
  other.submit(whole, 0x81, 1);
  CHECK(other.said().empty());
}

TEST_CASE("A second SET_CONFIGURATION is the end of a bus reset") {
  Held held;
  constexpr std::array<std::uint8_t, 8> kSetConfiguration{0, 9, 1, 0, 0, 0, 0, 0};
  held.control(1, kSetConfiguration);
  held.port.enumerate();
  CHECK(held.said() == std::vector<Said>{{kRetSubmit, 1, 0, 0, 0}});
  CHECK(held.port.resets == 0);
  held.submit(2, 0x81, 512);
  held.control(3, kSetConfiguration);
  CHECK(held.port.resets == 1);
  // The address, which the host gives again and its bus keeps to itself, comes before.
  REQUIRE(held.port.transfers.size() == 4);
  CHECK(held.port.transfers.front().setup[1] == 5);
  CHECK(held.port.transfers.back().setup == kSetConfiguration);
  held.port.enumerate();
  CHECK(held.said() == std::vector<Said>{{kRetSubmit, 2, -ESHUTDOWN, 0, 0}, {kRetSubmit, 3, 0, 0, 0}});
}

TEST_CASE("A device that is another one after the reset is lost to its holder") {
  Held held;
  constexpr std::array<std::uint8_t, 8> kSetConfiguration{0, 9, 1, 0, 0, 0, 0, 0};
  held.control(1, kSetConfiguration);
  held.settle();
  held.port.device_descriptor[10] = std::byte{0x0E};
  held.control(2, kSetConfiguration);
  held.settle();
  CHECK(held.device.left());
  held.device.release();
  CHECK(held.device.record() == nullptr);  // And may be another one still after the holder's end.
  held.settle();
  REQUIRE(held.device.record() != nullptr);
  CHECK(held.device.record()->product == 0x000E);
}

TEST_CASE("A device that leaves the bus is lost to its holder, and there for the next when it is back") {
  Held held;
  held.submit(1, 0x81, 512);
  held.port.leave();
  CHECK(held.said() == std::vector<Said>{{kRetSubmit, 1, -ESHUTDOWN, 0, 0}});
  CHECK(held.device.left());
  CHECK(held.device.record() == nullptr);
  held.device.release();
  CHECK(held.port.resets == 0);
  CHECK(held.device.import("1-1") == OpStatus::kNotAvailable);
  held.port.device_descriptor[10] = std::byte{0x0E};  // DFU mode.
  held.port.join();
  held.settle();
  REQUIRE(held.device.import("1-1") == OpStatus::kOk);
  CHECK(held.device.record()->product == 0x000E);
  CHECK_FALSE(held.device.left());
}

TEST_CASE("A device that left and joined between two looks is lost to its holder too") {
  Held held;
  held.port.leave();
  held.port.join();
  held.settle();
  CHECK(held.device.left());
  held.device.release();
  CHECK(held.port.resets == 0);  // It is fresh, and a reset means something to a device in DFU mode.
  held.settle();
  CHECK(held.device.import("1-1") == OpStatus::kOk);
}

TEST_CASE("A cable that a fault pulled is plugged in again") {
  Held held;
  held.port.unplug();
  held.settle();
  CHECK(held.port.plugged());
  CHECK(held.device.left());
}

}  // namespace
