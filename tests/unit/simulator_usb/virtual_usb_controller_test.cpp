// Cable, bus and endpoints: what ends what.
#include "protocol/frame.h"
#include "protocol/link_decoder.h"
#include "tests/unit/simulator_usb/socket_rig.h"

using namespace scatter;
using namespace scatter::simulator;
using Kind = firmware::UsbEvent::Kind;

namespace {

void expect_all_gone(SocketRig& rig, std::size_t count) {
  for (std::size_t i = 0; i < count; ++i) {
    const auto completion = rig.socket.next_completion();
    REQUIRE(completion.has_value());
    CHECK(completion->outcome == UsbOutcome::kGone);
  }
  CHECK(rig.quiet());
  CHECK(rig.socket.under_way() == 0);
}

/// Transfers that wait on every kind of endpoint.
std::size_t keep_busy(SocketRig& rig) {
  rig.ask(kPacket);
  rig.ask(kReport, kReportIn);
  rig.expect(rig.give(counting(OutPipe::kBulkCapacity)));
  rig.give(counting(10));
  rig.socket.submit(
      {.id = ++rig.last_id, .endpoint = 0x80, .setup = {0x80, 6, 0, 1, 0, 0, 18, 0}, .length = 18});
  return 4;
}

/// Whole wire frames, as the instrument sends them.
Bytes frame_of(std::uint32_t number) {
  Bytes bytes(600);
  protocol::FrameHeader header;
  header.channel = protocol::Channel::kStream;
  header.sequence = number;
  bytes.resize(protocol::write_frame(bytes, header, counting(500, number)));
  return bytes;
}

}  // namespace

TEST_CASE("The device is on the bus when it has joined and the cable is in, whichever comes first") {
  SettableClock clock;
  VirtualUsbController socket(clock, {}, 1);
  CHECK_FALSE(socket.present());
  socket.connect(true);
  CHECK_FALSE(socket.present());
  CHECK(socket.speed() == firmware::UsbSpeed::kNone);
  CHECK(socket.next_event().kind == Kind::kNone);
  socket.plug(UsbBusSpeed::kFull);
  CHECK(socket.present());
  CHECK(socket.joins() == 1);
  CHECK(socket.speed() == firmware::UsbSpeed::kFull);
  CHECK(socket.next_event().kind == Kind::kReset);
  socket.connect(false);
  CHECK_FALSE(socket.present());
  CHECK(socket.plugged());
  CHECK(socket.speed() == firmware::UsbSpeed::kNone);
  socket.connect(true);
  CHECK(socket.present());
  CHECK(socket.joins() == 2);
  socket.connect(true);
  CHECK(socket.joins() == 2);
}

TEST_CASE("Unplugging ends everything under way, and the device learns of it") {
  SocketRig rig;
  const std::size_t busy = keep_busy(rig);
  rig.socket.unplug();
  expect_all_gone(rig, busy);
  CHECK(rig.socket.next_event().kind == Kind::kUnplugged);
  CHECK(rig.socket.next_event().kind == Kind::kNone);
  rig.expect(rig.ask(kPacket), UsbOutcome::kGone);
  CHECK(rig.socket.write(kBulkIn, counting(5)) == 0);
}

TEST_CASE("A bus reset ends everything under way and closes the endpoints") {
  SocketRig rig;
  rig.socket.set_address(9);
  CHECK(rig.socket.address() == 9);
  const std::size_t busy = keep_busy(rig);
  rig.socket.reset();
  expect_all_gone(rig, busy);
  CHECK(rig.socket.address() == 0);
  CHECK(rig.socket.next_event().kind == Kind::kReset);
  CHECK(rig.socket.next_event().kind == Kind::kNone);
  rig.expect(rig.ask(kPacket), UsbOutcome::kError);
  rig.open();
  rig.send(counting(3));
  CHECK(rig.expect(rig.ask(kPacket)) == counting(3));
}

TEST_CASE("A device that leaves the bus ends everything under way") {
  SocketRig rig;
  const std::size_t busy = keep_busy(rig);
  rig.socket.connect(false);
  expect_all_gone(rig, busy);
  CHECK(rig.socket.next_event().kind == Kind::kNone);
}

TEST_CASE("What was complete before the cable came out can still be read") {
  SocketRig rig;
  const std::uint64_t id = rig.ask(kPacket);
  rig.send(counting(30));
  rig.socket.unplug();
  CHECK(rig.expect(id) == counting(30));
}

TEST_CASE("A transfer to an endpoint that is not open gets no handshake") {
  SocketRig rig;
  rig.expect(rig.ask(kPacket, 0x85), UsbOutcome::kError);
  rig.expect(rig.give(counting(3), 0x06), UsbOutcome::kError);
  rig.socket.open_endpoints({});
  rig.expect(rig.ask(kPacket), UsbOutcome::kError);
  CHECK(rig.socket.write(kBulkIn, counting(3)) == 0);
  CHECK(rig.socket.waiting(kBulkIn) == 0);
  CHECK(rig.device_takes(10).empty());
}

TEST_CASE("Closing some endpoints ends their transfers, and those of others go on") {
  SocketRig rig;
  const std::uint64_t bulk = rig.ask(kPacket);
  const std::uint64_t report = rig.ask(kReport, kReportIn);
  const std::array<firmware::UsbEndpoint, 1> reports_only{
      {{.address = kReportIn, .type = firmware::UsbEndpoint::Type::kInterrupt, .packet_bytes = kReport}}};
  rig.socket.open_endpoints(reports_only);
  rig.expect(bulk, UsbOutcome::kError);
  CHECK(rig.quiet());
  REQUIRE(rig.socket.write(kReportIn, counting(kReport)) == kReport);
  CHECK(rig.expect(report) == counting(kReport));
}

TEST_CASE("Opening endpoints anew empties both pipes") {
  SocketRig rig;
  rig.send(counting(100));
  rig.expect(rig.give(counting(100)));
  rig.open();
  CHECK(rig.socket.waiting(kBulkIn) == 0);
  CHECK(rig.device_takes(100).empty());
}

TEST_CASE(
    "Harmed frames: each fault of the plan strikes wire frames on the bulk pipe, as often as it counts") {
  SocketRig rig("drop:0.2+duplicate:0.2");
  constexpr std::uint32_t kFrames = 300;
  Bytes buffer(protocol::kMaxFrameBytes);
  protocol::LinkDecoder decoder(buffer);
  std::vector<int> seen(kFrames);
  for (std::uint32_t i = 0; i < kFrames; ++i) {
    const Bytes frame = frame_of(i);
    REQUIRE(rig.socket.write(kBulkIn, frame) == frame.size());
    rig.socket.end_transfer(kBulkIn);
    rig.ask(16 * kPacket);
    while (const auto completion = rig.socket.next_completion()) {
      decoder.push(completion->data, [&](const protocol::Frame& whole) { ++seen[whole.header().sequence]; });
    }
  }
  const FaultCounts& counts = rig.socket.fault_counts(Direction::kToHost);
  CHECK(counts.frames == kFrames);
  CHECK(counts.dropped > 0);
  CHECK(counts.duplicated > 0);
  CHECK(static_cast<std::uint64_t>(std::ranges::count(seen, 0)) == counts.dropped);
  CHECK(static_cast<std::uint64_t>(std::ranges::count(seen, 2)) == counts.duplicated);
}

TEST_CASE("A frame held back for reordering goes on by itself in time, as a transfer of its own") {
  SocketRig rig("reorder:1:to_host");
  const Bytes frame = frame_of(1);
  const std::uint64_t id = rig.ask(16 * kPacket);
  rig.send(frame);
  CHECK(rig.quiet());
  REQUIRE(rig.socket.next_event_us() == FrameFaults::kHoldUs);
  rig.clock.now = FrameFaults::kHoldUs;
  rig.socket.tick();
  CHECK(rig.expect(id) == frame);
}

TEST_CASE("A frame that was held back when the setting changed belongs to nobody") {
  SocketRig rig("reorder:1:to_host");
  rig.send(frame_of(1));
  rig.socket.open_endpoints({});
  rig.open();
  CHECK_FALSE(rig.socket.next_event_us().has_value());
  rig.ask(16 * kPacket);
  rig.clock.now = 10 * FrameFaults::kHoldUs;
  rig.socket.tick();
  CHECK(rig.quiet());
}
