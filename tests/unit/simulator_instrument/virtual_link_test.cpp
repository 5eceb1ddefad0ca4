#include <catch2/catch.hpp>

#include <algorithm>
#include <numeric>

#include "simulator/instrument/virtual_link.h"

using namespace scatter;
using namespace scatter::simulator;

namespace {

using Bytes = std::vector<std::byte>;

Bytes counting(std::size_t size, std::size_t from = 0) {
  Bytes bytes(size);
  for (std::size_t i = 0; i < size; ++i) {
    bytes[i] = static_cast<std::byte>((from + i) * 7 % 251);
  }
  return bytes;
}

struct Rig {
  explicit Rig(std::string_view faults = "") : link(clock, plan(faults), 1) { link.attach(); }
  static FaultPlan plan(std::string_view faults) {
    FaultPlan result;
    if (!faults.empty()) {
      REQUIRE(add_faults(faults, result).has_value());
    }
    return result;
  }
  Bytes host_takes(std::size_t most) {
    Bytes out(most);
    out.resize(link.host_read(out));
    return out;
  }
  VirtualClock clock{ClockMode::kVirtual};
  VirtualLink link;
};

}  // namespace

TEST_CASE("Bytes cross the link in order in both directions, in any pieces") {
  Rig rig;
  const Bytes sent = counting(50'000);
  CHECK(rig.link.write(sent) == sent.size());
  CHECK(rig.link.host_write(sent) == sent.size());
  Bytes host;
  Bytes device;
  for (std::size_t piece = 1; host.size() < sent.size(); piece = piece % 977 + 1) {
    const Bytes some = rig.host_takes(piece);
    host.insert(host.end(), some.begin(), some.end());
    Bytes other(piece);
    other.resize(rig.link.read(other));
    device.insert(device.end(), other.begin(), other.end());
  }
  CHECK(host == sent);
  CHECK(device == sent);
  CHECK(rig.link.readable() == 0);
}

TEST_CASE("A host that does not read makes the device wait, and nothing is lost") {
  Rig rig;
  const Bytes sent = counting(VirtualLink::kToHostCapacity + 1000);
  const std::size_t taken = rig.link.write(sent);
  CHECK(taken == VirtualLink::kToHostCapacity);
  CHECK(rig.link.write(std::span(sent).subspan(taken)) == 0);
  Bytes got = rig.host_takes(5000);
  CHECK(rig.link.write(std::span(sent).subspan(taken)) == 1000);
  const Bytes rest = rig.host_takes(sent.size());
  got.insert(got.end(), rest.begin(), rest.end());
  CHECK(got == sent);
}

TEST_CASE("A device that does not read makes the host wait") {
  Rig rig;
  const Bytes sent = counting(VirtualLink::kToDeviceCapacity + 1);
  CHECK(rig.link.host_write(sent) == VirtualLink::kToDeviceCapacity);
  CHECK(rig.link.writable() == 0);
}

TEST_CASE("Without a host the device's bytes are discarded, and a new host finds nothing of the old one") {
  Rig rig;
  CHECK(rig.link.write(counting(10)) == 10);
  CHECK(rig.link.host_write(counting(10)) == 10);
  rig.link.detach();
  CHECK_FALSE(rig.link.connected());
  CHECK(rig.link.write(counting(10)) == 10);
  CHECK(rig.link.host_write(counting(10)) == 0);
  rig.link.attach();
  CHECK(rig.link.readable() == 0);
  Bytes out(10);
  CHECK(rig.link.read(out) == 0);
}

TEST_CASE("What a device sent before it restarted can still be read") {
  Rig rig;
  CHECK(rig.link.write(counting(100)) == 100);
  CHECK(rig.link.host_write(counting(100)) == 100);
  rig.link.device_gone();
  CHECK_FALSE(rig.link.attached());
  CHECK(rig.host_takes(1000) == counting(100));
  CHECK(rig.link.writable() == 0);
  Bytes out(10);
  CHECK(rig.link.read(out) == 0);
}

TEST_CASE("A stall holds everything from its byte on for its time, then lets it go") {
  Rig rig("stall:100:250");
  rig.clock.advance_to(5000);
  CHECK(rig.link.write(counting(300)) == 300);
  CHECK(rig.host_takes(300) == counting(100));
  CHECK(rig.link.readable() == 0);
  REQUIRE(rig.link.next_event_us() == 5000 + 250'000U);
  rig.clock.advance_to(5000 + 249'999);
  CHECK(rig.link.readable() == 0);
  rig.clock.advance_to(5000 + 250'000);
  CHECK(rig.host_takes(300) == counting(200, 100));
  CHECK_FALSE(rig.link.next_event_us().has_value());
}

TEST_CASE("A stall without a time is for ever, in the other direction too") {
  Rig rig("stall:0:to_device");
  rig.clock.advance_to(3'600'000'000);
  CHECK(rig.link.host_write(counting(1)) == 0);
  CHECK_FALSE(rig.link.next_event_us().has_value());
  CHECK(rig.link.write(counting(5)) == 5);
  CHECK(rig.host_takes(5).size() == 5);
}

TEST_CASE("A disconnect breaks the link at its byte, once") {
  Rig rig("disconnect:100");
  CHECK(rig.link.write(counting(300)) == 300);
  CHECK(rig.host_takes(300) == counting(100));
  CHECK_FALSE(rig.link.attached());
  CHECK(rig.link.readable() == 0);
  rig.link.attach();
  CHECK(rig.link.write(counting(300)) == 300);
  CHECK(rig.host_takes(300) == counting(300));
  CHECK(rig.link.attached());
}

TEST_CASE("A disconnect towards the device counts the host's bytes") {
  Rig rig("disconnect:64:to_device");
  CHECK(rig.link.host_write(counting(100)) == 64);
  CHECK_FALSE(rig.link.attached());
}
