// Firmware updates over the wire: what is refused before anything is erased, how a download goes on after a
// break, and how a trial ends.
#include <catch2/catch.hpp>

#include "tests/unit/firmware/update_device.h"

using namespace scatter::firmware;
using namespace scatter::firmware::fake;
using namespace scatter::protocol;

TEST_CASE("A board with slots and a verifier offers updates; one without says so") {
  Device device;
  CHECK((device.hello.capabilities & kCapabilityUpdate) != 0);
  CHECK((device.hello.capabilities & kCapabilityRescue) == 0);
  FakeBoard bare;
  FakeHost host(bare);
  CHECK((host.hello().capabilities & kCapabilityUpdate) == 0);
  CHECK(host.status_of(UpdateStatus{}) == StatusCode::kUnimplemented);
}

TEST_CASE("An update from A to B: received, verified, tried, confirmed, kept") {
  Device device;
  UpdateState state = device.state();
  CHECK(state.phase == UpdatePhase::kIdle);
  CHECK(state.running_slot == 0);
  CHECK(state.running_version.str() == "1.0.0");
  CHECK(state.running_verdict == SlotVerdict::kConfirmed);
  CHECK(state.other_verdict == SlotVerdict::kEmpty);
  CHECK(state.slot_bytes == 4 * 4096 - 1024);
  CHECK(state.chunk_bytes == 4096);

  const Image b = Device::image("2.0.0", 1, 3);
  device.send(b);
  state = device.state();
  CHECK(state.phase == UpdatePhase::kReady);
  CHECK(state.received == 9000);
  CHECK(state.other_version.str() == "2.0.0");
  CHECK(state.other_verdict == SlotVerdict::kReady);
  CHECK(state.lowest_counter == 1);

  device.boot(ResetReason::kRequested);
  CHECK(device.decision.slot == 1);
  state = device.state();
  CHECK(state.phase == UpdatePhase::kTrial);
  CHECK(state.running_slot == 1);
  CHECK(state.running_version.str() == "2.0.0");
  CHECK(state.running_verdict == SlotVerdict::kTrial);
  CHECK(state.other_verdict == SlotVerdict::kConfirmed);
  CHECK(device.host->status_of(UpdateConfirm{}) == StatusCode::kOk);
  CHECK(device.host->status_of(UpdateConfirm{}) == StatusCode::kOk);  // Again is no harm.
  state = device.state();
  CHECK(state.phase == UpdatePhase::kIdle);
  CHECK(state.running_verdict == SlotVerdict::kConfirmed);
  CHECK(state.lowest_counter == 3);

  device.boot();
  CHECK(device.decision.slot == 1);
  // And back again, into the slot that was left.
  device.send(Device::image("3.0.0", 0, 3));
  device.boot();
  CHECK(device.decision.slot == 0);
}

TEST_CASE("An update that nobody confirms is reverted, and can be tried again") {
  Device device;
  const Image b = Device::image("2.0.0", 1);
  device.send(b);
  device.boot(ResetReason::kRequested);
  REQUIRE(device.decision.slot == 1);
  device.boot(ResetReason::kWatchdog);
  CHECK(device.decision.slot == 0);
  const UpdateState state = device.state();
  CHECK(state.phase == UpdatePhase::kIdle);
  CHECK(state.other_verdict == SlotVerdict::kReverted);
  device.send(b);
  device.boot(ResetReason::kRequested);
  CHECK(device.decision.slot == 1);
  CHECK(device.host->status_of(UpdateConfirm{}) == StatusCode::kOk);
  device.boot();
  CHECK(device.decision.slot == 1);
}

TEST_CASE("What must not be installed is refused before anything is erased, with expected and found") {
  Device device;
  device.slots.install(Device::image("1.5.0", 1, 2),
                       {{MarkKind::kReady, 0}, {MarkKind::kTried, 0}, {MarkKind::kConfirmed, 2}});
  device.boot();
  REQUIRE(device.decision.slot == 1);
  const std::vector<std::byte> before = device.cells(0);
  ImageSpec spec{.version = "2.0.0", .counter = 2, .slot = 0};
  StatusCode code = StatusCode::kInvalidArgument;
  std::string text;
  Image image = make_image(spec);
  SECTION("signed by a stranger") {
    sign(image, Signer::kStranger);
    code = StatusCode::kPermissionDenied;
    text = "not signed by a key";
  }
  SECTION("one bit of the header flipped") {
    image.header_bytes[84] ^= std::byte{1};
    code = StatusCode::kPermissionDenied;
    text = "not signed";
  }
  SECTION("for another product") {
    spec.product = "HS-2";
    image = make_image(spec);
    text = "product \"HS-2\", expected \"HS-1 test\"";
  }
  SECTION("a step back") {
    spec.counter = 1;
    image = make_image(spec);
    text = "security counter is 1, expected at least 2";
  }
  SECTION("linked for the slot that runs") {
    spec.slot = 1;
    image = make_image(spec);
    text = "linked for slot 1, expected slot 0";
  }
  SECTION("linked for another address") {
    image.header.load_address += 4096;
    sign(image, Signer::kTestKey);
    text = "linked for address";
  }
  SECTION("longer than the slot") {
    image.header.body_bytes = 4 * 4096 - 1024 + 1;
    sign(image, Signer::kTestKey);
    text = "has 15361 bytes, expected 1 to 15360";
  }
  SECTION("no image at all") {
    image.header_bytes.assign(kImageHeaderBytes, std::byte{0x42});
    text = "no image header";
  }
  SECTION("of a later header version") {
    image.header.header_version = 2;
    sign(image, Signer::kTestKey);
    text = "no image header";
  }
  const StatusReply reply = device.begin(image);
  CHECK(reply.status == code);
  INFO(reply.text.str());
  CHECK(reply.text.str().find(text) != std::string_view::npos);
  CHECK(device.cells(0) == before);
  CHECK(device.host->status_of(UpdateFinish{}) == StatusCode::kFailedPrecondition);
}

TEST_CASE("Writes are taken in order, repeats change nothing, and everything else names what was expected") {
  Device device;
  const Image b = Device::image("2.0.0", 1);
  CHECK(device.write(b, 0, 64).status == StatusCode::kFailedPrecondition);  // Nothing begun.
  REQUIRE(device.begin(b).status == StatusCode::kOk);
  REQUIRE(device.write(b, 0, 4096).status == StatusCode::kOk);
  CHECK(device.write(b, 0, 4096).status == StatusCode::kOk);     // Duplicate.
  CHECK(device.write(b, 1024, 2048).status == StatusCode::kOk);  // Within what is there.
  StatusReply reply = device.write(b, 8192, 808);                // Reordered.
  CHECK(reply.status == StatusCode::kOutOfRange);
  CHECK(reply.text.str() == "offset is 8192, expected 4096");
  reply = device.write(b, 4096, 33);
  CHECK(reply.status == StatusCode::kInvalidArgument);
  CHECK(reply.text.str() == "chunk has 33 bytes, expected a multiple of 32 up to 4096");
  UpdateWrite past;
  past.offset = 8192;
  past.data = std::span(b.body).first(1000);
  CHECK(device.host->ask(past).as<StatusReply>().status == StatusCode::kOutOfRange);
  Image other = b;
  other.body[100] ^= std::byte{1};
  CHECK(device.write(other, 64, 64).status == StatusCode::kDataLoss);
  CHECK(device.host->status_of(UpdateFinish{}) == StatusCode::kFailedPrecondition);  // Incomplete.
  device.write_rest(b, 9000);
  CHECK(device.host->status_of(UpdateFinish{}) == StatusCode::kOk);
  CHECK(device.host->status_of(UpdateFinish{}) == StatusCode::kOk);
}

TEST_CASE("A body that is not the signed one is refused at the end and never starts") {
  Device device;
  const Image b = Device::image("2.0.0", 1);
  Image damaged = b;
  damaged.body[GENERATE(0U, 4500U, 8999U)] ^= std::byte{0x40};
  REQUIRE(device.begin(b).status == StatusCode::kOk);
  device.write_rest(damaged, 9000);
  const StatusReply reply = device.host->ask(UpdateFinish{}).as<StatusReply>();
  CHECK(reply.status == StatusCode::kDataLoss);
  CHECK(device.state().other_verdict == SlotVerdict::kEmpty);
  device.boot();
  CHECK(device.decision.slot == 0);
  device.send(b);  // From the start.
  device.boot();
  CHECK(device.decision.slot == 1);
}

TEST_CASE("After a reset the same begin resumes at the erase unit that was being written") {
  Device device;
  const Image b = Device::image("2.0.0", 1, 1, 15'000);
  REQUIRE(device.begin(b).status == StatusCode::kOk);
  device.write_rest(b, 12'288);
  device.boot();
  CHECK(device.decision.slot == 0);
  CHECK(device.state().phase == UpdatePhase::kReceiving);
  const std::uint64_t erases = device.slots.parts[1].erases(1);
  REQUIRE(device.begin(b).status == StatusCode::kOk);
  // Body bytes up to 12287 end in unit 3, which holds those from 3 * 4096 - 1024 on.
  CHECK(device.state().received == 3 * 4096 - 1024);
  CHECK(device.slots.parts[1].erases(1) == erases);  // What is kept was not erased.
  device.write_rest(b, 15'000);
  CHECK(device.host->status_of(UpdateFinish{}) == StatusCode::kOk);
  device.boot();
  CHECK(device.decision.slot == 1);
}

TEST_CASE("Another image begun after a break starts from nothing, and so does a cut in the first unit") {
  Device device;
  REQUIRE(device.begin(Device::image("2.0.0", 1)).status == StatusCode::kOk);
  device.write_rest(Device::image("2.0.0", 1), 8192);
  device.boot();
  const Image c = Device::image("2.1.0", 1);
  REQUIRE(device.begin(c).status == StatusCode::kOk);
  CHECK(device.state().received == 0);
  REQUIRE(device.write(c, 0, 1024).status == StatusCode::kOk);
  device.boot();
  REQUIRE(device.begin(c).status == StatusCode::kOk);
  CHECK(device.state().received == 0);
  device.write_rest(c, 9000);
  CHECK(device.host->status_of(UpdateFinish{}) == StatusCode::kOk);
}

TEST_CASE("A new session in the middle of a download goes on where the old one was") {
  Device device;
  const Image b = Device::image("2.0.0", 1);
  REQUIRE(device.begin(b).status == StatusCode::kOk);
  device.write_rest(b, 4096);
  SECTION("HELLO again") {
    device.host->session = 0x4321;
    device.host->hello();
  }
  SECTION("unplugged and plugged in again") {
    device.board.link.attached = false;
    device.host->run_for(1'000);
    device.board.link.attached = true;
    device.host->session = 0x4321;
    device.host->hello();
  }
  CHECK(device.state().received == 4096);
  device.write_rest(b, 9000);
  CHECK(device.host->status_of(UpdateFinish{}) == StatusCode::kOk);
}

TEST_CASE("A host that goes away while the slot is erased leaves nothing half-done that looks whole") {
  Device device;
  const Image b = Device::image("2.0.0", 1);
  UpdateBegin message;
  std::ranges::transform(b.header_bytes, message.header.begin(),
                         [](std::byte byte) { return static_cast<std::uint8_t>(byte); });
  (void)device.host->send(message);
  for (int polls = 0; polls < 3; ++polls) {
    device.host->poll();
  }
  device.board.link.attached = false;
  device.host->run_for(1'000);
  device.board.link.attached = true;
  device.host->session = 0x4321;
  device.host->hello();
  CHECK(device.write(b, 0, 1024).status == StatusCode::kFailedPrecondition);
  device.send(b);
}

TEST_CASE("Erasing takes one unit per turn of the main loop and promises its reply first") {
  Device device;
  const Image b = Device::image("2.0.0", 1);
  UpdateBegin message;
  std::ranges::transform(b.header_bytes, message.header.begin(),
                         [](std::byte byte) { return static_cast<std::uint8_t>(byte); });
  const std::uint16_t correlation = device.host->send(message);
  std::uint64_t before = device.slots.supply.operations();
  int turns = 0;
  while (!device.host->final_reply(correlation)) {
    device.host->poll();
    const std::uint64_t now = device.slots.supply.operations();
    CHECK(now - before <= 1);
    before = now;
    REQUIRE(++turns < 100);
  }
  const auto replies = device.host->replies(correlation);
  REQUIRE(replies.size() == 2);
  CHECK(replies[0].as<StatusReply>().status == StatusCode::kPending);
  CHECK(replies[0].as<StatusReply>().pending_ms == UpdateReceiver::kPendingMs);
  CHECK(replies[1].as<StatusReply>().status == StatusCode::kOk);
}

TEST_CASE("A slow erase promises anew before its deadline passes") {
  Device device;
  const Image b = Device::image("2.0.0", 1);
  UpdateBegin message;
  std::ranges::transform(b.header_bytes, message.header.begin(),
                         [](std::byte byte) { return static_cast<std::uint8_t>(byte); });
  const std::uint16_t correlation = device.host->send(message);
  while (!device.host->final_reply(correlation)) {
    device.host->poll();
    device.board.clock.time_us += 1'500'000;  // A unit of a large flash takes this long.
  }
  std::uint64_t promised_until = 0;
  for (const Received& reply : device.host->replies(correlation)) {
    CHECK((promised_until == 0 || reply.at_us <= promised_until));
    promised_until = reply.at_us + 1000ULL * reply.as<StatusReply>().pending_ms;
  }
}

TEST_CASE("No update during a run, no run while a slot is erased") {
  Device device;
  const std::uint32_t epoch = device.host->configure(fixed_recipe());
  device.host->start(epoch);
  const Image b = Device::image("2.0.0", 1);
  CHECK(device.begin(b).status == StatusCode::kFailedPrecondition);
  CHECK(device.host->status_of(UpdateFinish{}) == StatusCode::kFailedPrecondition);
  device.host->ask(Abort{});
  UpdateBegin message;
  std::ranges::transform(b.header_bytes, message.header.begin(),
                         [](std::byte byte) { return static_cast<std::uint8_t>(byte); });
  const std::uint16_t begin = device.host->send(message);
  const std::uint16_t start = device.host->send(Start{.epoch = epoch, .may_send_until = 100});
  REQUIRE(device.host->run(10'000'000, [&] { return device.host->final_reply(begin).has_value(); }));
  REQUIRE(device.host->final_reply(start).has_value());
  CHECK(device.host->final_reply(start)->as<StatusReply>().status == StatusCode::kFailedPrecondition);
  device.host->start(epoch);  // Between two writes there is nothing in the way.
}

TEST_CASE("While an image is on trial its fallback is not overwritten") {
  Device device;
  device.send(Device::image("2.0.0", 1));
  device.boot(ResetReason::kRequested);
  REQUIRE(device.decision.slot == 1);
  const StatusReply reply = device.begin(Device::image("3.0.0", 0));
  CHECK(reply.status == StatusCode::kFailedPrecondition);
  REQUIRE(device.host->status_of(UpdateConfirm{}) == StatusCode::kOk);
  CHECK(device.begin(Device::image("3.0.0", 0)).status == StatusCode::kOk);
}

TEST_CASE("Worn flash is reported and the running image stays") {
  Device device;
  const Image b = Device::image("2.0.0", 1);
  SECTION("a unit that cannot be erased") {
    device.slots.parts[1].overwrite(4096, std::vector<std::byte>(64, std::byte{0}));
    device.slots.parts[1].wear_out(1);
    const StatusReply reply = device.begin(b);
    CHECK(reply.status == StatusCode::kDataLoss);
    CHECK(reply.text.str() == "flash unit 1 of slot 1 cannot be erased: it is worn out");
  }
  SECTION("a unit that wears out while it is written") {
    REQUIRE(device.begin(b).status == StatusCode::kOk);
    device.slots.parts[1].wear_out(1);
    const StatusReply reply = device.write(b, 0, 4096);
    CHECK(reply.status == StatusCode::kDataLoss);
    CHECK(device.write(b, 0, 4096).status == StatusCode::kFailedPrecondition);
  }
  SECTION("a marks unit that takes no mark") {
    REQUIRE(device.begin(b).status == StatusCode::kOk);
    device.write_rest(b, 9000);
    device.slots.parts[1].wear_out(4);
    CHECK(device.host->status_of(UpdateFinish{}) == StatusCode::kDataLoss);
  }
  device.boot();
  CHECK(device.decision.slot == 0);
}

TEST_CASE("Bit rot in the other slot is seen by update_status") {
  Device device;
  device.slots.install(Device::image("0.9.0", 1),
                       {{MarkKind::kReady, 0}, {MarkKind::kTried, 0}, {MarkKind::kConfirmed, 1}});
  device.slots.parts[1].rot(5000, 0x80);
  device.boot();
  REQUIRE(device.decision.slot == 0);
  const UpdateState state = device.state();
  CHECK(state.other_verdict == SlotVerdict::kBadBody);
  CHECK(state.other_version.str() == "0.9.0");
}
