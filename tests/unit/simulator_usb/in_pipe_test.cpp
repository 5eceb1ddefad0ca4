// What a host's IN transfer gets: USB 2.0 sections 5.8.3 (bulk) and 5.7.3 (interrupt).
#include <algorithm>

#include "tests/unit/simulator_usb/socket_rig.h"

using namespace scatter;
using namespace scatter::simulator;

TEST_CASE("A transfer of the device that ends in a short packet ends the host's transfer there") {
  SocketRig rig;
  const std::uint64_t id = rig.ask(16 * kPacket);
  rig.send(counting(3 * kPacket + 1));
  CHECK(rig.expect(id) == counting(3 * kPacket + 1));
  CHECK(rig.quiet());
}

TEST_CASE("A device's transfer of whole packets ends by a packet of no bytes, once") {
  SocketRig rig;
  const std::uint64_t first = rig.ask(16 * kPacket);
  const std::uint64_t second = rig.ask(16 * kPacket);
  rig.send(counting(2 * kPacket));
  rig.socket.end_transfer(kBulkIn);
  CHECK(rig.expect(first) == counting(2 * kPacket));
  CHECK(rig.quiet());
  rig.send(counting(5));
  CHECK(rig.expect(second) == counting(5));
}

TEST_CASE("A host's transfer that is full leaves the packet of no bytes to the next one") {
  SocketRig rig;
  const std::uint64_t first = rig.ask(2 * kPacket);
  const std::uint64_t second = rig.ask(2 * kPacket);
  const std::uint64_t third = rig.ask(2 * kPacket);
  rig.send(counting(2 * kPacket));
  rig.send(counting(9));
  CHECK(rig.expect(first) == counting(2 * kPacket));
  CHECK(rig.expect(second).empty());
  CHECK(rig.expect(third) == counting(9));
}

TEST_CASE("The same holds when the device was first") {
  SocketRig rig;
  rig.send(counting(2 * kPacket));
  rig.send(counting(9));
  CHECK(rig.expect(rig.ask(2 * kPacket)) == counting(2 * kPacket));
  CHECK(rig.expect(rig.ask(2 * kPacket)).empty());
  CHECK(rig.expect(rig.ask(2 * kPacket)) == counting(9));
}

TEST_CASE("Bytes that begin a packet wait on the device until the packet is full or ended") {
  SocketRig rig;
  const std::uint64_t id = rig.ask(2 * kPacket);
  REQUIRE(rig.socket.write(kBulkIn, counting(kPacket + 100)) == kPacket + 100);
  CHECK(rig.quiet());
  REQUIRE(rig.socket.write(kBulkIn, counting(kPacket - 100, kPacket + 100)) == kPacket - 100);
  CHECK(rig.expect(id) == counting(2 * kPacket));
  // The next host's transfer gets the end alone.
  const std::uint64_t next = rig.ask(2 * kPacket);
  rig.socket.end_transfer(kBulkIn);
  CHECK(rig.expect(next).empty());
}

TEST_CASE("Any lengths of the host's and the device's transfers give the same bytes") {
  for (const std::size_t length : {kPacket, 2 * kPacket, 7 * kPacket, 64 * kPacket}) {
    for (const std::size_t sent : {std::size_t{1}, kPacket - 1, kPacket, kPacket + 1, 5 * kPacket, 4000UL}) {
      CAPTURE(length, sent);
      SocketRig rig;
      Bytes all;
      Bytes got;
      for (int i = 0; i < 20; ++i) {
        rig.send(counting(sent, all.size()));
        const Bytes more = counting(sent, all.size());
        all.insert(all.end(), more.begin(), more.end());
      }
      while (true) {
        const std::uint64_t id = rig.ask(length);
        if (const auto completion = rig.socket.next_completion()) {
          REQUIRE(completion->id == id);
          CHECK(completion->data.size() <= length);
          got.insert(got.end(), completion->data.begin(), completion->data.end());
        } else {
          break;
        }
      }
      CHECK(got == all);
      CHECK(rig.socket.waiting(kBulkIn) == 0);
    }
  }
}

TEST_CASE("A packet that does not fit into what is left of the host's transfer babbles and is lost") {
  SocketRig rig;
  rig.send(counting(3 * kPacket + 7));
  const std::uint64_t small = rig.ask(kPacket + 100);
  CHECK(rig.expect(small, UsbOutcome::kBabble).empty());
  const std::uint64_t rest = rig.ask(16 * kPacket);
  CHECK(rig.expect(rest) == counting(kPacket + 7, 2 * kPacket));
}

TEST_CASE("The beginning of a packet babbles nowhere: it is not on the bus yet") {
  SocketRig rig;
  REQUIRE(rig.socket.write(kBulkIn, counting(kPacket + 10)) == kPacket + 10);
  const std::uint64_t id = rig.ask(kPacket + 1);
  CHECK(rig.quiet());
  CHECK(rig.socket.cancel(id));
  CHECK(rig.expect(id, UsbOutcome::kCancelled) == counting(kPacket));
}

TEST_CASE("A host that does not ask makes the device wait, and nothing is lost") {
  SocketRig rig;
  const Bytes all = counting(InPipe::kBulkCapacity + 4 * kPacket);
  CHECK(rig.socket.write(kBulkIn, all) == InPipe::kBulkCapacity);
  CHECK(rig.socket.waiting(kBulkIn) == InPipe::kBulkCapacity);
  CHECK(rig.socket.host_is_slow());
  const std::uint64_t first = rig.ask(4 * kPacket);
  CHECK_FALSE(rig.socket.write(kBulkIn, std::span(all).subspan(InPipe::kBulkCapacity)) == 0);
  CHECK(rig.expect(first) == counting(4 * kPacket));
  rig.socket.end_transfer(kBulkIn);
  const std::uint64_t rest = rig.ask(2 * InPipe::kBulkCapacity);
  CHECK(rig.expect(rest) == counting(InPipe::kBulkCapacity, 4 * kPacket));
  CHECK_FALSE(rig.socket.host_is_slow());
}

TEST_CASE("One transfer of the host may be longer than what the device can hold") {
  SocketRig rig;
  const Bytes all = counting(3 * InPipe::kBulkCapacity);
  const std::uint64_t id = rig.ask(4 * InPipe::kBulkCapacity);
  CHECK(rig.socket.write(kBulkIn, all) == all.size());
  CHECK(rig.quiet());
  rig.socket.end_transfer(kBulkIn);
  CHECK(rig.expect(id) == all);
}

TEST_CASE("A device that never ends its transfer needs no more memory than it may hold") {
  SocketRig rig;
  Bytes got;
  Bytes sent;
  for (int i = 0; i < 200; ++i) {
    const Bytes some = counting(1000, sent.size());
    sent.insert(sent.end(), some.begin(), some.end());
    REQUIRE(rig.socket.write(kBulkIn, some) == some.size());
    rig.ask(kPacket);
    while (auto completion = rig.socket.next_completion()) {
      got.insert(got.end(), completion->data.begin(), completion->data.end());
    }
  }
  CHECK(got.size() == 200 * kPacket);
  CHECK(std::equal(got.begin(), got.end(), sent.begin()));
  CHECK(rig.socket.waiting(kBulkIn) == sent.size() - got.size());
}

TEST_CASE("A cancelled transfer hands over the packets that had come") {
  SocketRig rig;
  const std::uint64_t first = rig.ask(16 * kPacket);
  const std::uint64_t second = rig.ask(16 * kPacket);
  REQUIRE(rig.socket.write(kBulkIn, counting(2 * kPacket + 5)) == 2 * kPacket + 5);
  CHECK(rig.socket.under_way() == 2);
  CHECK(rig.socket.cancel(first));
  CHECK_FALSE(rig.socket.cancel(first));
  CHECK(rig.expect(first, UsbOutcome::kCancelled) == counting(2 * kPacket));
  rig.socket.end_transfer(kBulkIn);
  CHECK(rig.expect(second) == counting(5, 2 * kPacket));
  CHECK(rig.socket.under_way() == 0);
  CHECK_FALSE(rig.socket.cancel(77));
}

TEST_CASE("A report is a transfer of its own, and the device keeps only a few") {
  SocketRig rig;
  for (std::size_t i = 0; i < InPipe::kReportsWaiting; ++i) {
    CHECK(rig.socket.write(kReportIn, counting(kReport, i)) == kReport);
  }
  CHECK(rig.socket.write(kReportIn, counting(kReport)) == 0);
  CHECK_FALSE(rig.socket.host_is_slow());  // Nobody has to read reports.
  for (std::size_t i = 0; i < InPipe::kReportsWaiting; ++i) {
    const std::uint64_t id = rig.ask(kReport, kReportIn);
    CHECK(rig.expect(id) == counting(kReport, i));
  }
  const std::uint64_t id = rig.ask(kReport, kReportIn);
  CHECK(rig.quiet());
  CHECK(rig.socket.write(kReportIn, counting(10)) == 10);
  CHECK(rig.expect(id) == counting(10));
}

TEST_CASE("A halted endpoint stalls until the halt ends, and begins anew then") {
  SocketRig rig;
  const std::uint64_t waiting = rig.ask(kPacket);
  REQUIRE(rig.socket.write(kBulkIn, counting(9)) == 9);
  rig.socket.set_halt(kBulkIn, true);
  CHECK(rig.socket.halted(kBulkIn));
  CHECK_FALSE(rig.socket.halted(kBulkOut));
  CHECK(rig.expect(waiting, UsbOutcome::kStalled).empty());
  rig.expect(rig.ask(kPacket), UsbOutcome::kStalled);
  CHECK(rig.socket.write(kBulkIn, counting(9)) == 0);
  rig.socket.set_halt(kBulkIn, false);
  CHECK(rig.socket.waiting(kBulkIn) == 0);
  const std::uint64_t id = rig.ask(kPacket);
  rig.send(counting(4));
  CHECK(rig.expect(id) == counting(4));
}

TEST_CASE("The host's memory comes back filled where a whole transfer fits: no second copy") {
  SocketRig rig;
  rig.ask(16 * kPacket);
  REQUIRE(rig.socket.write(kBulkIn, counting(5000)) == 5000);
  rig.socket.end_transfer(kBulkIn);
  Bytes buffer = rig.expect(rig.last_id);
  const std::byte* const memory = buffer.data();
  // The next two frames travel through the same memory.
  for (int i = 0; i < 2; ++i) {
    rig.socket.submit(
        {.id = ++rig.last_id, .endpoint = kBulkIn, .data = std::move(buffer), .length = 16 * kPacket});
    rig.send(counting(5000));
    rig.ask(16 * kPacket);
    rig.send(counting(5000));
    buffer = rig.expect(rig.last_id - 1);
    const Bytes other = rig.expect(rig.last_id);
    CHECK((buffer.data() == memory || other.data() == memory));
    if (other.data() == memory) {
      buffer = other;
      break;
    }
  }
}

// --- faults

TEST_CASE("usb_short: transfers end early and nothing is lost, even when every one does") {
  for (const auto& [faults, length] :
       {std::pair{"usb_short:0.3", 16 * kPacket}, std::pair{"usb_short:1", 16 * kPacket},
        std::pair{"usb_short:0.3", kPacket}}) {
    CAPTURE(faults, length);
    SocketRig rig(faults);
    Bytes all;
    Bytes got;
    for (int i = 0; i < 20; ++i) {
      const Bytes some = counting(i % 2 == 0 ? 700 : 3 * kPacket, all.size());
      all.insert(all.end(), some.begin(), some.end());
      rig.send(some);
    }
    for (int i = 0; i < 20'000 && rig.socket.waiting(kBulkIn) > 0; ++i) {
      const Bytes some = rig.expect(rig.ask(length));
      got.insert(got.end(), some.begin(), some.end());
    }
    CHECK(got == all);
    CHECK(rig.socket.usb_fault_counts().shorts > 0);
    CHECK(rig.socket.usb_fault_counts().transfers > 20);
  }
}

TEST_CASE("usb_babble: the bytes of one transfer are lost, the next is whole") {
  SocketRig rig("usb_babble:0.5");
  std::size_t lost = 0;
  for (std::size_t i = 0; i < 200; ++i) {
    rig.send(counting(1000, i));
    const std::uint64_t id = rig.ask(16 * kPacket);
    const auto completion = rig.socket.next_completion();
    REQUIRE(completion.has_value());
    CHECK(completion->id == id);
    if (completion->outcome == UsbOutcome::kBabble) {
      ++lost;
      CHECK(completion->data.empty());
    } else {
      CHECK(completion->data == counting(1000, i));
    }
  }
  CHECK(rig.socket.usb_fault_counts().babbles == lost);
  CHECK(rig.socket.usb_fault_counts().transfers == 200);
  // 200 draws at 1/2: five standard deviations are 35.
  CHECK(lost > 65);
  CHECK(lost < 135);
}

TEST_CASE("usb_stall: the endpoint halts until the device ends it, and what waited is lost") {
  SocketRig rig("usb_stall:1");
  rig.send(counting(100));
  rig.expect(rig.ask(kPacket), UsbOutcome::kStalled);
  CHECK(rig.socket.halted(kBulkIn));
  rig.expect(rig.ask(kPacket), UsbOutcome::kStalled);
  CHECK(rig.socket.usb_fault_counts().stalls == 1);
  rig.socket.set_halt(kBulkIn, false);
  CHECK(rig.socket.waiting(kBulkIn) == 0);
}

TEST_CASE("The same seed breaks the same transfers, another seed others") {
  const auto outcomes = [](std::uint64_t seed) {
    SocketRig rig("usb_babble:0.2+usb_short:0.2", seed);
    std::vector<std::pair<UsbOutcome, std::size_t>> list;
    for (int i = 0; i < 100; ++i) {
      rig.send(counting(800));
    }
    while (rig.socket.waiting(kBulkIn) > 0) {
      rig.ask(16 * kPacket);
      const auto completion = rig.socket.next_completion();
      list.emplace_back(completion->outcome, completion->actual);
    }
    return list;
  };
  CHECK(outcomes(1) == outcomes(1));
  CHECK(outcomes(1) != outcomes(2));
}

TEST_CASE("Faults of transfers leave reports alone") {
  SocketRig rig("usb_babble:1+usb_stall:1+usb_short:1+drop:1");
  for (std::size_t i = 0; i < 50; ++i) {
    REQUIRE(rig.socket.write(kReportIn, counting(kReport, i)) == kReport);
    CHECK(rig.expect(rig.ask(kReport, kReportIn)) == counting(kReport, i));
  }
}

TEST_CASE("stall: the host's transfer waits for its time, then all of it comes") {
  SocketRig rig("stall:700:250");
  rig.clock.now = 5000;
  const std::uint64_t id = rig.ask(16 * kPacket);
  rig.send(counting(1500));
  CHECK(rig.quiet());
  REQUIRE(rig.socket.next_event_us() == 5000U + std::uint64_t{250'000});
  rig.clock.now = 5000 + 249'999;
  rig.socket.tick();
  CHECK(rig.quiet());
  rig.clock.now = 5000 + 250'000;
  rig.socket.tick();
  CHECK(rig.expect(id) == counting(1500));
  CHECK_FALSE(rig.socket.next_event_us().has_value());
}

TEST_CASE("disconnect: the cable is out from its byte on, and may be plugged again") {
  SocketRig rig("disconnect:1700");
  rig.send(counting(1000));
  CHECK(rig.expect(rig.ask(16 * kPacket)) == counting(1000));
  const std::uint64_t cut = rig.ask(16 * kPacket);
  const std::uint64_t behind = rig.ask(16 * kPacket);
  rig.send(counting(1000));
  rig.expect(cut, UsbOutcome::kGone);
  rig.expect(behind, UsbOutcome::kGone);
  CHECK_FALSE(rig.socket.plugged());
  CHECK_FALSE(rig.socket.present());
  CHECK(rig.socket.next_event().kind == firmware::UsbEvent::Kind::kUnplugged);
  rig.socket.plug(UsbBusSpeed::kHigh);
  CHECK(rig.socket.present());
  CHECK(rig.socket.next_event().kind == firmware::UsbEvent::Kind::kReset);
  rig.open();
  rig.send(counting(5000));
  CHECK(rig.expect(rig.ask(16 * kPacket)) == counting(5000));
}
