// Control transfers: USB 2.0 section 5.5 and 8.5.3.
#include <algorithm>

#include "tests/unit/simulator_usb/socket_rig.h"

using namespace scatter;
using namespace scatter::simulator;
using Kind = firmware::UsbEvent::Kind;

namespace {

using Setup = std::array<std::uint8_t, 8>;

Setup setup_in(std::uint16_t length, std::uint8_t request = 6) {
  return {0x80,
          request,
          0,
          1,
          0,
          0,
          static_cast<std::uint8_t>(length & 0xFFU),
          static_cast<std::uint8_t>(length >> 8U)};
}
Setup setup_out(std::uint16_t length, std::uint8_t request = 1) {
  return {0x21,
          request,
          0,
          0,
          2,
          0,
          static_cast<std::uint8_t>(length & 0xFFU),
          static_cast<std::uint8_t>(length >> 8U)};
}

std::uint64_t request_in(SocketRig& rig, std::uint16_t length, std::uint8_t request = 6) {
  rig.socket.submit(
      {.id = ++rig.last_id, .endpoint = 0x80, .setup = setup_in(length, request), .length = length});
  return rig.last_id;
}
std::uint64_t request_out(SocketRig& rig, Bytes data) {
  const Setup setup = setup_out(static_cast<std::uint16_t>(data.size()));
  rig.socket.submit({.id = ++rig.last_id, .endpoint = 0x00, .setup = setup, .data = std::move(data)});
  return rig.last_id;
}

}  // namespace

TEST_CASE("A request for data shows its SETUP packet and gets at most what it asked for") {
  SocketRig rig;
  const std::uint64_t id = request_in(rig, 18);
  const firmware::UsbEvent event = rig.socket.next_event();
  REQUIRE(event.kind == Kind::kSetup);
  CHECK(event.setup == setup_in(18));
  CHECK(rig.socket.next_event().kind == Kind::kNone);
  rig.socket.control_send(counting(40));
  CHECK(rig.expect(id) == counting(18));

  const std::uint64_t shorter = request_in(rig, 255);
  (void)rig.socket.next_event();
  rig.socket.control_send(counting(40));
  CHECK(rig.expect(shorter) == counting(40));
}

TEST_CASE("Data to the device arrives before its answer, and the host learns how much went") {
  SocketRig rig;
  const std::uint64_t id = request_out(rig, counting(300));
  REQUIRE(rig.socket.next_event().kind == Kind::kSetup);
  Bytes room(1024);
  rig.socket.control_receive(room);
  CHECK(rig.quiet());
  const firmware::UsbEvent data = rig.socket.next_event();
  REQUIRE(data.kind == Kind::kControlData);
  CHECK(data.size == 300);
  room.resize(300);
  CHECK(room == counting(300));
  rig.socket.control_accept();
  rig.expect(id);
  CHECK(rig.last_actual == 300);
}

TEST_CASE("A refused request is stalled, and the next one is served as if nothing had been") {
  SocketRig rig;
  const std::uint64_t refused = request_in(rig, 18);
  (void)rig.socket.next_event();
  rig.socket.control_stall();
  rig.expect(refused, UsbOutcome::kStalled);
  const std::uint64_t after_data = request_out(rig, counting(10));
  (void)rig.socket.next_event();
  Bytes room(4);
  rig.socket.control_receive(room);
  CHECK(rig.socket.next_event().size == 4);
  rig.socket.control_stall();
  rig.expect(after_data, UsbOutcome::kStalled);
  const std::uint64_t next = request_in(rig, 2);
  (void)rig.socket.next_event();
  rig.socket.control_send(counting(2));
  CHECK(rig.expect(next) == counting(2));
}

TEST_CASE("Requests wait for each other: the device sees one at a time, in order") {
  SocketRig rig;
  const std::uint64_t first = request_in(rig, 4, 1);
  const std::uint64_t second = request_in(rig, 4, 2);
  CHECK(rig.socket.under_way() == 2);
  CHECK(rig.socket.next_event().setup[1] == 1);
  CHECK(rig.socket.next_event().kind == Kind::kNone);
  rig.socket.control_send(counting(4, 1));
  CHECK(rig.socket.next_event().setup[1] == 2);
  rig.socket.control_send(counting(4, 2));
  CHECK(rig.expect(first) == counting(4, 1));
  CHECK(rig.expect(second) == counting(4, 2));
}

TEST_CASE("The answer to a cancelled request never reaches the next one") {
  for (const bool taken : {false, true}) {
    CAPTURE(taken);
    SocketRig rig;
    const std::uint64_t first = request_in(rig, 4, 1);
    if (taken) {
      CHECK(rig.socket.next_event().setup[1] == 1);
    }
    const std::uint64_t second = request_in(rig, 4, 2);
    CHECK(rig.socket.cancel(first));
    rig.expect(first, UsbOutcome::kCancelled);
    rig.socket.control_send(counting(4, 1));  // Late.
    CHECK(rig.quiet());
    CHECK(rig.socket.next_event().setup[1] == 2);
    rig.socket.control_send(counting(4, 2));
    CHECK(rig.expect(second) == counting(4, 2));
  }
}

TEST_CASE("A request that waits behind another can be cancelled") {
  SocketRig rig;
  const std::uint64_t first = request_in(rig, 4, 1);
  const std::uint64_t second = request_in(rig, 4, 2);
  CHECK(rig.socket.cancel(second));
  rig.expect(second, UsbOutcome::kCancelled);
  (void)rig.socket.next_event();
  rig.socket.control_send(counting(4));
  rig.expect(first);
  CHECK(rig.socket.next_event().kind == Kind::kNone);
}

TEST_CASE("A request during whose data stage the host gives up leaves nothing behind") {
  SocketRig rig;
  const std::uint64_t id = request_out(rig, counting(10));
  (void)rig.socket.next_event();
  Bytes room(16);
  rig.socket.control_receive(room);
  CHECK(rig.socket.cancel(id));
  rig.expect(id, UsbOutcome::kCancelled);
  CHECK(rig.socket.next_event().kind == Kind::kNone);
  rig.socket.control_accept();
  CHECK(rig.quiet());
}
