#include "tests/unit/simulator_usb/socket_rig.h"

using namespace scatter;
using namespace scatter::simulator;

TEST_CASE("The host's bytes reach the device in order, in any pieces") {
  SocketRig rig;
  Bytes sent;
  Bytes got;
  for (std::size_t piece = 1; sent.size() < 50'000; piece = piece * 3 % 1777 + 1) {
    const Bytes some = counting(piece, sent.size());
    sent.insert(sent.end(), some.begin(), some.end());
    rig.expect(rig.give(some));
    CHECK(rig.last_actual == piece);
    const Bytes taken = rig.device_takes(piece % 601 + 1);
    got.insert(got.end(), taken.begin(), taken.end());
  }
  const Bytes rest = rig.device_takes(sent.size());
  got.insert(got.end(), rest.begin(), rest.end());
  CHECK(got == sent);
}

TEST_CASE("A device that does not read makes the host wait") {
  SocketRig rig;
  rig.expect(rig.give(counting(OutPipe::kBulkCapacity - 100)));
  const std::uint64_t waits = rig.give(counting(300, 1));
  CHECK(rig.quiet());
  CHECK(rig.socket.under_way() == 1);
  // Part of a packet makes no room for a packet.
  CHECK(rig.device_takes(150).size() == 150);
  CHECK(rig.quiet());
  CHECK(rig.device_takes(50).size() == 50);
  rig.expect(waits);
  CHECK(rig.last_actual == 300);
}

TEST_CASE("A transfer longer than the device's queue goes as the device reads") {
  SocketRig rig;
  const Bytes all = counting(3 * OutPipe::kBulkCapacity + 11);
  const std::uint64_t id = rig.give(all);
  Bytes got;
  while (got.size() < all.size()) {
    const Bytes some = rig.device_takes(1000);
    REQUIRE_FALSE(some.empty());
    got.insert(got.end(), some.begin(), some.end());
  }
  CHECK(got == all);
  rig.expect(id);
  CHECK(rig.last_actual == all.size());
}

TEST_CASE("A transfer of no bytes is done at once") {
  SocketRig rig;
  rig.expect(rig.give({}));
  CHECK(rig.last_actual == 0);
  CHECK(rig.device_takes(10).empty());
}

TEST_CASE("A cancelled transfer says how much of it the device has") {
  SocketRig rig;
  const std::uint64_t first = rig.give(counting(OutPipe::kBulkCapacity + 1000));
  const std::uint64_t second = rig.give(counting(10));
  CHECK(rig.socket.cancel(first));
  rig.expect(first, UsbOutcome::kCancelled);
  CHECK(rig.last_actual == OutPipe::kBulkCapacity);
  CHECK(rig.socket.cancel(second));
  rig.expect(second, UsbOutcome::kCancelled);
  CHECK(rig.last_actual == 0);
  CHECK(rig.device_takes(2 * OutPipe::kBulkCapacity).size() == OutPipe::kBulkCapacity);
}

TEST_CASE("The device takes whole packets or none") {
  SocketRig rig;
  rig.expect(rig.give(counting(OutPipe::kBulkCapacity - kPacket - 100)));
  const std::uint64_t id = rig.give(counting(2000));
  CHECK(rig.socket.cancel(id));
  rig.expect(id, UsbOutcome::kCancelled);
  CHECK(rig.last_actual == kPacket);
}

TEST_CASE("A report is taken as one, and only a few wait") {
  SocketRig rig;
  for (std::size_t i = 0; i < OutPipe::kReportsWaiting; ++i) {
    rig.expect(rig.give(counting(kReport - i, i), kReportOut));
  }
  const std::uint64_t waits = rig.give(counting(kReport, 99), kReportOut);
  CHECK(rig.quiet());
  CHECK(rig.device_takes(1000, kReportOut) == counting(kReport));
  rig.expect(waits);
  for (std::size_t i = 1; i < OutPipe::kReportsWaiting; ++i) {
    CHECK(rig.device_takes(1000, kReportOut) == counting(kReport - i, i));
  }
  CHECK(rig.device_takes(1000, kReportOut) == counting(kReport, 99));
}

TEST_CASE("A halted endpoint stalls what comes and forgets what waited when the halt ends") {
  SocketRig rig;
  rig.expect(rig.give(counting(100)));
  rig.socket.set_halt(kBulkOut, true);
  rig.expect(rig.give(counting(100)), UsbOutcome::kStalled);
  rig.socket.set_halt(kBulkOut, false);
  CHECK(rig.device_takes(1000).empty());
  rig.expect(rig.give(counting(7)));
  CHECK(rig.device_takes(1000) == counting(7));
}

TEST_CASE("stall and disconnect towards the device count the host's bytes") {
  SocketRig rig("stall:64:10:to_device+disconnect:200:to_device");
  const std::uint64_t id = rig.give(counting(100));
  CHECK(rig.quiet());
  CHECK(rig.device_takes(1000) == counting(64));
  REQUIRE(rig.socket.next_event_us() == 10'000U);
  rig.clock.now = 10'000;
  rig.socket.tick();
  rig.expect(id);
  CHECK(rig.device_takes(1000) == counting(36, 64));
  const std::uint64_t cut = rig.give(counting(101));
  rig.expect(cut, UsbOutcome::kGone);
  CHECK_FALSE(rig.socket.plugged());
}
