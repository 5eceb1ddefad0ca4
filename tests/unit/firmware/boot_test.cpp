// The bootloader's decision: which image runs, and that every good image is found.
#include <catch2/catch.hpp>

#include "firmware/boot/boot_decision.h"
#include "firmware/image/slot_view.h"
#include "tests/unit/firmware/test_images.h"

using namespace scatter::firmware;
using namespace scatter::firmware::fake;
using scatter::protocol::ResetReason;
using scatter::protocol::SlotVerdict;
using Action = BootDecision::Action;

namespace {

constexpr std::string_view kProduct = "HS-1 test";

struct Device {
  explicit Device(Flash::Geometry geometry = {.unit_bytes = 4096, .units = 5, .program_bytes = 32})
      : slots(geometry) {}
  TestSlots slots;
  RememberingVerifier verifier;

  BootDecision boot(ResetReason reason = ResetReason::kPowerOn) {
    slots.supply.power_on();
    const BootDecision decision = decide(slots, verifier, kProduct, reason);
    slots.runs = decision.slot;
    CHECK(slots.violations() == 0);
    return decision;
  }
  Image image(std::uint8_t slot, std::uint32_t counter = 1) {
    return make_image({.version = slot == 0 ? "1.0.0" : "2.0.0",
                       .counter = counter,
                       .slot = slot,
                       .slot_bytes = slots.slot_bytes()});
  }
  MarkKind last_mark(std::uint8_t slot) { return read_marks(slots.slot(slot)).last; }
};

constexpr std::pair<MarkKind, std::uint32_t> kReadyMark{MarkKind::kReady, 0};
constexpr std::pair<MarkKind, std::uint32_t> kTriedMark{MarkKind::kTried, 0};
constexpr std::pair<MarkKind, std::uint32_t> confirmed(std::uint32_t number) {
  return {MarkKind::kConfirmed, number};
}

}  // namespace

TEST_CASE("A device with one confirmed image runs it") {
  Device device;
  device.slots.install(device.image(0), {confirmed(1)});
  const BootDecision decision = device.boot();
  CHECK(decision.action == Action::kRun);
  CHECK(decision.slot == 0);
  CHECK_FALSE(decision.trial);
  CHECK(decision.verdicts[0] == SlotVerdict::kConfirmed);
  CHECK(decision.verdicts[1] == SlotVerdict::kEmpty);
  CHECK(decision.lowest_counter == 1);
}

TEST_CASE("A ready image is tried once, marked as tried before it starts, and reverted at the next boot") {
  Device device;
  device.slots.install(device.image(0), {confirmed(1)});
  device.slots.install(device.image(1), {kReadyMark});
  const BootDecision trial = device.boot();
  CHECK(trial.slot == 1);
  CHECK(trial.trial);
  CHECK(trial.verdicts[1] == SlotVerdict::kTrial);
  CHECK(device.last_mark(1) == MarkKind::kTried);
  const BootDecision after = device.boot(ResetReason::kWatchdog);
  CHECK(after.slot == 0);
  CHECK_FALSE(after.trial);
  CHECK(after.verdicts[1] == SlotVerdict::kReverted);
  CHECK(device.last_mark(1) == MarkKind::kReverted);
  CHECK(device.boot().slot == 0);
}

TEST_CASE("A confirmed image stays, and the confirmation with the highest number wins") {
  Device device;
  device.slots.install(device.image(0), {kReadyMark, kTriedMark, confirmed(8)});
  device.slots.install(device.image(1), {kReadyMark, kTriedMark, confirmed(7)});
  CHECK(device.boot().slot == 0);
  CHECK(device.boot().slot == 0);
}

TEST_CASE("When the confirmed image rots the other confirmed one runs, with its own verdict for each") {
  Device device;
  device.slots.install(device.image(0), {confirmed(1)});
  device.slots.install(device.image(1, 2), {kReadyMark, kTriedMark, confirmed(2)});
  REQUIRE(device.boot().slot == 1);
  device.slots.parts[1].rot(scatter::protocol::kImageBodyOffset + 5000, 0x10);
  const BootDecision decision = device.boot();
  CHECK(decision.slot == 0);
  CHECK(decision.verdicts[1] == SlotVerdict::kBadBody);
  // The rotten image was confirmed, and its signed header still stands: nothing older than it may follow.
  CHECK(decision.lowest_counter == 2);
}

TEST_CASE("Flash that cannot be read rejects the slot, wherever it lies") {
  const std::uint32_t at = GENERATE(0U, 100U, 1024U, 9000U);
  Device device;
  device.slots.install(device.image(0), {confirmed(1)});
  device.slots.install(device.image(1), {kReadyMark});
  device.slots.parts[1].trap(at, 32);
  const BootDecision decision = device.boot();
  CHECK(decision.slot == 0);
  CHECK(decision.verdicts[1] == SlotVerdict::kUnreadable);
}

TEST_CASE("Every single flipped bit of a ready image's header keeps it from starting") {
  Device device;
  device.slots.install(device.image(0), {confirmed(1)});
  const Image image = device.image(1);
  for (std::uint32_t bit = 0; bit < 8 * scatter::protocol::kImageHeaderBytes; ++bit) {
    device.slots.install(image, {kReadyMark});
    device.slots.parts[1].rot(bit / 8, static_cast<std::uint8_t>(1U << bit % 8));
    const BootDecision decision = device.boot();
    INFO("bit " << bit);
    CHECK(decision.slot == 0);
    CHECK((decision.verdicts[1] == SlotVerdict::kBadHeader ||
           decision.verdicts[1] == SlotVerdict::kWrongProduct));
  }
}

TEST_CASE("Flipped bits anywhere in a ready image's body keep it from starting") {
  Device device;
  device.slots.install(device.image(0), {confirmed(1)});
  const Image image = device.image(1);
  for (std::uint32_t at = 0; at < image.body.size(); at += 61) {
    device.slots.install(image, {kReadyMark});
    device.slots.parts[1].rot(scatter::protocol::kImageBodyOffset + at,
                              static_cast<std::uint8_t>(1U << at % 8));
    INFO("byte " << at);
    const BootDecision decision = device.boot();
    CHECK(decision.slot == 0);
    CHECK(decision.verdicts[1] == SlotVerdict::kBadBody);
  }
}

TEST_CASE("An image that is not for this device or not trusted is never started") {
  Device device;
  device.slots.install(device.image(0, 5), {confirmed(1)});
  ImageSpec spec{.version = "2.0.0", .counter = 5, .slot = 1, .slot_bytes = device.slots.slot_bytes()};
  SlotVerdict expected = SlotVerdict::kBadHeader;
  SECTION("signed by a stranger") {
    spec.signer = Signer::kStranger;
  }
  SECTION("for another product") {
    spec.product = "HS-2";
    expected = SlotVerdict::kWrongProduct;
  }
  SECTION("linked for another address") {
    spec.slot_bytes += 4096;
  }
  SECTION("a step back") {
    spec.counter = 4;
    expected = SlotVerdict::kRolledBack;
  }
  device.slots.install(make_image(spec), {kReadyMark});
  BootDecision decision = device.boot();
  CHECK(decision.slot == 0);
  CHECK(decision.verdicts[1] == expected);
  CHECK(device.last_mark(1) == MarkKind::kReady);  // Not tried.

  // Nor when nothing else is left, unless a step back is all that is wrong: then no confirmed image forbids
  // it.
  device.slots.parts[0].trap(0, 256);
  decision = device.boot();
  CHECK((decision.action == Action::kRescue) == (expected != SlotVerdict::kRolledBack));
}

TEST_CASE("An image in the wrong slot is never started") {
  Device device;
  device.slots.install(device.image(0), {confirmed(1)});
  const Image wrong = device.image(0);
  device.slots.parts[1].overwrite(0, wrong.header_bytes);
  device.slots.parts[1].overwrite(scatter::protocol::kImageBodyOffset, wrong.body);
  REQUIRE(write_mark(device.slots.slot(1), MarkKind::kReady));
  const BootDecision decision = device.boot();
  CHECK(decision.slot == 0);
  CHECK(decision.verdicts[1] == SlotVerdict::kBadHeader);
}

TEST_CASE("A release build refuses the test key even when it is listed") {
  const Image image = make_image({});
  const std::span<const TrustedKey> listed(&kTestKey, 1);
  const auto verified = [&](TestKey test_key) {
    SodiumVerifier verifier(listed, test_key);
    return verifier.verify(std::span(image.header_bytes).first(scatter::protocol::kSignedHeaderBytes),
                           image.header.signature, image.header.key_id);
  };
  CHECK(verified(TestKey::kTaken));
  CHECK_FALSE(verified(TestKey::kRefused));
  // Nor under another name.
  TrustedKey renamed = kTestKey;
  renamed.id[0] ^= 1U;
  SodiumVerifier verifier({&renamed, 1}, TestKey::kRefused);
  CHECK_FALSE(verifier.verify(std::span(image.header_bytes).first(scatter::protocol::kSignedHeaderBytes),
                              image.header.signature, renamed.id));
}

TEST_CASE("Nothing good means rescue mode") {
  Device device;
  CHECK(device.boot().action == Action::kRescue);
  device.slots.install(device.image(0), {confirmed(1)});
  device.slots.install(device.image(1), {kReadyMark});
  device.slots.parts[0].rot(2000, 1);
  device.slots.parts[1].rot(2000, 1);
  const BootDecision decision = device.boot();
  CHECK(decision.action == Action::kRescue);
  CHECK(decision.slot == ImageSlots::kCount);
  CHECK(decision.verdicts[0] == SlotVerdict::kBadBody);
  CHECK(decision.verdicts[1] == SlotVerdict::kBadBody);
}

TEST_CASE("The last good image runs though it was tried before, but not again right after a crash") {
  Device device;
  device.slots.install(device.image(0), {confirmed(1)});
  device.slots.install(device.image(1), {kReadyMark, kTriedMark});
  device.slots.parts[0].rot(2000, 1);
  CHECK(device.boot(ResetReason::kPowerOn).slot == 1);
  CHECK(device.boot(ResetReason::kWatchdog).action == Action::kRescue);
  CHECK(device.boot(ResetReason::kFault).action == Action::kRescue);
  const BootDecision decision = device.boot(ResetReason::kRequested);
  CHECK(decision.slot == 1);
  CHECK(decision.trial);
}

TEST_CASE("A whole image without marks, as production may leave it, starts on trial") {
  Device device;
  device.slots.install(device.image(1), {});
  const BootDecision decision = device.boot();
  CHECK(decision.slot == 1);
  CHECK(decision.trial);
  CHECK(device.last_mark(1) == MarkKind::kTried);
}

TEST_CASE("An incomplete download is told apart from a damaged image and never started") {
  Device device;
  device.slots.install(device.image(0), {confirmed(1)});
  const Image image = device.image(1);
  device.slots.parts[1].overwrite(0, image.header_bytes);
  device.slots.parts[1].overwrite(scatter::protocol::kImageBodyOffset, std::span(image.body).first(4096));
  const BootDecision decision = device.boot();
  CHECK(decision.slot == 0);
  CHECK(decision.verdicts[1] == SlotVerdict::kReceiving);
}

TEST_CASE("A mark with one good copy is completed before it is acted on") {
  Device device;
  device.slots.install(device.image(0), {kReadyMark, kTriedMark, confirmed(3)});
  device.slots.parts[0].rot(4 * 4096 + 5 * 32, 0x04);  // The second copy of the confirmation.
  REQUIRE(read_marks(device.slots.slot(0)).copies == 1);
  CHECK(device.boot().slot == 0);
  const Marks marks = read_marks(device.slots.slot(0));
  CHECK(marks.last == MarkKind::kConfirmed);
  CHECK(marks.number == 3);
  CHECK(marks.copies == 2);
}

TEST_CASE("Marks work on every geometry of flash, and with places that are worn") {
  const auto geometry = GENERATE(Flash::Geometry{4096, 2, 8}, Flash::Geometry{8192, 3, 16},
                                 Flash::Geometry{65536, 3, 32}, Flash::Geometry{131072, 4, 64});
  Device device(geometry);
  Flash& flash = device.slots.slot(0);
  CHECK(read_marks(flash).last == MarkKind::kNone);
  CHECK_FALSE(read_marks(flash).any);
  REQUIRE(write_mark(flash, MarkKind::kReady));
  const SlotLayout layout = layout_of(flash);
  REQUIRE(layout.usable);
  CHECK(layout.body_capacity == geometry.unit_bytes * (geometry.units - 1) - 1024);
  // The next place traps: the mark goes behind it.
  device.slots.parts[0].trap(layout.marks_offset + 2 * layout.place_bytes, layout.place_bytes);
  REQUIRE(write_mark(flash, MarkKind::kTried));
  REQUIRE(write_mark(flash, MarkKind::kConfirmed, 77));
  const Marks marks = read_marks(flash);
  CHECK(marks.last == MarkKind::kConfirmed);
  CHECK(marks.number == 77);
  CHECK(marks.copies == 2);
  CHECK(device.slots.violations() == 0);
}

TEST_CASE("A full marks unit refuses further marks and says so") {
  Device device;
  Flash& flash = device.slots.slot(0);
  for (std::uint32_t i = 0; i < kMarkPlaces / 2; ++i) {
    REQUIRE(write_mark(flash, MarkKind::kReady));
  }
  CHECK_FALSE(write_mark(flash, MarkKind::kTried));
  CHECK(read_marks(flash).last == MarkKind::kReady);
  CHECK(device.slots.violations() == 0);
}

TEST_CASE("An image whose trial cannot be marked is not tried while another one is confirmed") {
  Device device;
  device.slots.install(device.image(0), {confirmed(1)});
  device.slots.install(device.image(1), {kReadyMark});
  device.slots.parts[1].wear_out(4);
  const BootDecision decision = device.boot();
  CHECK(decision.slot == 0);
  CHECK(decision.verdicts[1] == SlotVerdict::kReady);
}
