// Interface 0 as the carrier of frames: who is attached, what a transfer holds, what stays of a host that
// went.
#include <catch2/catch.hpp>

#include "protocol/frame.h"
#include "tests/unit/firmware_usb/usb_host.h"

using namespace scatter::firmware;
using namespace scatter::firmware::fake;
using scatter::protocol::RunEnd;
using scatter::protocol::RunState;

// PROVES: SPEC 11.4
TEST_CASE("A measurement over USB gives every frame, one wire frame in each transfer") {
  UsbBoard board;
  UsbHost usb(board);
  usb.attach();
  usb.host.hello();
  const auto end = usb.host.measure(fixed_recipe());
  CHECK(end.reason == static_cast<std::uint8_t>(RunEnd::kCompleted));
  CHECK(usb.host.frames.size() == end.frames_sent);
  CHECK(end.frames_sent == 10);  // 2 LEDs x 2 exposures x 2 repeats, and a dark one for each repeat.
  REQUIRE_FALSE(usb.transfers().empty());
  for (const Bytes& transfer : usb.transfers()) {
    // The length in the header (SPEC 1) is the whole transfer's.
    CHECK(u32(transfer, 8) + scatter::protocol::kFrameOverhead == transfer.size());
  }
  CHECK(board.bus.misuse == std::vector<std::string>());
}

TEST_CASE("Nobody is attached before setting 1 is chosen, and bytes for nobody are discarded") {
  UsbBoard board;
  board.enumerate();
  CHECK_FALSE(board.link->connected());
  CHECK(board.link->write(bytes({1, 2, 3})) == 3);
  board.link->end_frame();
  CHECK(board.set_interface(0, 1));
  board.settle();
  CHECK(board.link->connected());
  CHECK(board.bus.in(0x81).empty());
}

// PROVES: SPEC 11.4
TEST_CASE("Frames that wait for a slow host still come one in each transfer") {
  UsbBoard board;
  UsbHost usb(board);
  usb.attach();
  usb.host.hello();
  usb.host.start(usb.host.configure(fixed_recipe()));
  usb.reading = false;
  board.pass(200'000);
  const std::size_t before = usb.transfers().size();
  const std::size_t waiting = board.bus.waiting(0x81);
  usb.reading = true;
  REQUIRE(usb.host.run(60'000'000, [&] { return !usb.host.all<scatter::protocol::RunFinished>().empty(); }));
  REQUIRE(usb.transfers().size() > before + 2);
  for (const Bytes& transfer : usb.transfers()) {
    CHECK(u32(transfer, 8) + scatter::protocol::kFrameOverhead == transfer.size());
  }
  // More than one frame had gathered.
  CHECK(waiting > usb.transfers()[before].size());
}

// PROVES: SPEC 11.2
TEST_CASE("The device ends run and session when the host's program is gone and setting 0 comes back") {
  UsbBoard board;
  UsbHost usb(board);
  usb.attach();
  usb.host.hello();
  usb.host.start(usb.host.configure(fixed_recipe()));
  usb.host.run_for(5'000);
  REQUIRE(board.instrument->run_state() != RunState::kIdle);
  CHECK(board.set_interface(0, 0));
  board.settle();
  CHECK(board.instrument->run_state() == RunState::kIdle);
  CHECK(board.instrument->run_report().reason == static_cast<std::uint8_t>(RunEnd::kHostGone));
  CHECK_FALSE(board.instrument->session_open());
  CHECK(board.board.optics.lit == Illuminator::kNone);
}

// PROVES: SPEC 11.2
TEST_CASE("Choosing setting 1 again is a detach, even when the core had no turn in between") {
  UsbBoard board;
  UsbHost usb(board);
  usb.attach();
  usb.host.hello();
  REQUIRE(board.instrument->session_open());
  // Both within one turn of the USB logic; the core is not polled.
  board.bus.setup({0x01, 11, 0, 0, 0, 0, 0, 0});
  (void)board.usb->poll();
  board.bus.setup({0x01, 11, 1, 0, 0, 0, 0, 0});
  for (int i = 0; i < 10; ++i) {
    (void)board.usb->poll();
  }
  CHECK(board.instrument->session_open());
  (void)board.instrument->poll();
  CHECK_FALSE(board.instrument->session_open());
  board.settle();
  CHECK(board.link->connected());
  usb.host.hello();
  CHECK(board.instrument->session_open());
}

// PROVES: SPEC 11.2
TEST_CASE("What a host did not take is not there for the next one") {
  UsbBoard board;
  UsbHost usb(board);
  usb.attach();
  usb.host.hello();
  usb.host.start(usb.host.configure(fixed_recipe()));
  usb.reading = false;
  board.pass(100'000);
  REQUIRE(board.bus.waiting(0x81) > 0);
  REQUIRE(board.set_interface(0, 1));
  board.settle();
  CHECK(board.bus.waiting(0x81) == 0);
  usb.reading = true;
  const std::size_t before = usb.transfers().size();
  usb.host.session = 0x4321;
  usb.host.hello();
  // The reply to HELLO is the first thing that the new host reads: id 0x8001, its session.
  REQUIRE(usb.transfers().size() > before);
  CHECK(u16(usb.transfers()[before], 6) == 0x8001);
  CHECK(u16(usb.transfers()[before], 16) == 0x4321);
}

TEST_CASE("Bytes that come right behind SET_INTERFACE are not lost") {
  UsbBoard board;
  board.enumerate();
  UsbHost usb(board);
  board.bus.setup({0x01, 11, 1, 0, 0, 0, 0, 0});
  (void)board.usb->poll();
  REQUIRE(board.bus.endpoints.count(0x02) == 1);
  usb.host.hello();  // Its packet lies in the endpoint before the core knows of the host.
  CHECK(board.instrument->session_open());
}

TEST_CASE("A restart waits until the host has taken its answer") {
  UsbBoard board;
  UsbHost usb(board);
  usb.attach();
  usb.host.hello();
  usb.reading = false;
  const std::uint16_t correlation = usb.host.send(scatter::protocol::Reboot{});
  usb.host.run_for(100'000);
  REQUIRE(board.bus.waiting(0x81) > 0);
  CHECK(board.board.keeper.reboots == 0);
  usb.reading = true;
  usb.host.run_for(100'000);
  CHECK(usb.host.final_reply(correlation)->as<scatter::protocol::StatusReply>().status ==
        scatter::protocol::StatusCode::kOk);
  CHECK(board.board.keeper.reboots == 1);
}

// PROVES: SPEC 11.5
TEST_CASE("A halted bulk endpoint holds the stream, and clearing it goes on with the next frame") {
  UsbBoard board;
  UsbHost usb(board);
  usb.attach();
  usb.host.hello();
  usb.host.start(usb.host.configure(fixed_recipe()));
  REQUIRE(usb.host.run(1'000'000, [&] { return usb.host.frames.size() >= 2; }));
  CHECK_FALSE(board.control(0x02, 3, 0, 0x81, 0).stalled);
  board.pass(50'000);
  CHECK(board.instrument->run_state() != RunState::kIdle);
  CHECK_FALSE(board.control(0x02, 1, 0, 0x81, 0).stalled);
  CHECK(board.link->connected());
}
