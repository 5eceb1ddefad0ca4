// Whole downloads of .scfw files over USB DFU, in blocks of any size: what becomes ready, what is refused
// before anything is erased, and what goes on after a break.
#include <catch2/catch.hpp>

#include "firmware/boot/boot_decision.h"
#include "host_sdk/firmware_files/package.h"
#include "protocol/crc.h"
#include "tests/unit/firmware/dfu_host.h"

using namespace scatter::firmware;
using namespace scatter::firmware::fake;
using scatter::protocol::ResetReason;
using scatter::simulator::CutKind;
using Code = DfuRequestCode;
using State = DfuState;

namespace {

const scatter::firmware_files::Package& package() {
  static const auto made = make_package();
  return made;
}
const Bytes& file() {
  static const Bytes bytes = package().bytes();
  return bytes;
}
/// Offset of image 1, which slot 1 takes.
constexpr std::size_t kImage1 = 64 + (256 + 9000 + 63) / 64 * 64;

}  // namespace

TEST_CASE("The firmware's idea of a .scfw is the host's") {
  namespace files = scatter::firmware_files;
  CHECK(kPackageMaxBodyBytes == files::kMaxBodyBytes);
  CHECK(std::size_t{kDfuSuffixBytes} == files::kDfuSuffixBytes);
  CHECK(std::size_t{ImageSlots::kCount} == files::kImages);
  using scatter::protocol::load_le;
  CHECK(load_le<std::uint32_t>(file().data()) == kPackageMagic);
  CHECK(load_le<std::uint16_t>(file().data() + 4) == kPackageVersion);
  CHECK(load_le<std::uint32_t>(file().data() + 16) == kPackageTableBytes);
  CHECK(load_le<std::uint32_t>(file().data() + 24) == kImage1);
  CHECK(load_le<std::uint32_t>(file().data() + 8) == file().size());
}

TEST_CASE("The device's memory is what its contract says") {
  CHECK(sizeof(PackageStream) <= 5200);
  CHECK(sizeof(DfuDevice) <= 5248);
}

TEST_CASE(
    "A whole download in blocks of any size is ready, tried at the next boot, and touches nothing else") {
  const std::size_t block = GENERATE(8U, 64U, 1000U, 4096U);
  const bool suffix = GENERATE(false, true);
  const std::uint8_t running = GENERATE(std::uint8_t{0}, std::uint8_t{1});
  const auto other = static_cast<std::uint8_t>(1 - running);
  DfuHost host(running);
  const Bytes before = host.cells(running);
  const auto end = host.download(suffix ? with_suffix(file()) : file(), block);
  INFO("block " << block << ", suffix " << suffix << ", running " << int{running});
  CHECK(end.status == DfuStatus::kOk);
  CHECK(end.state == State::kIdle);
  CHECK(host.ready_with(package(), other));
  CHECK(host.cells(running) == before);
  CHECK(host.device->bus_reset() == DfuAfterReset::kRestart);
  CHECK(host.slots.violations() == 0);
  const BootDecision decision = decide(host.slots, host.verifier, DfuHost::kProduct, ResetReason::kRequested);
  CHECK(decision.slot == other);
  CHECK(decision.trial);
}

TEST_CASE("Files for bodies that end anywhere against blocks and granules are taken whole") {
  const std::uint32_t size = GENERATE(range(4000U, 4200U, 13U));
  const auto odd = make_package({.body_bytes = {size, size + 7}});
  const Bytes bytes = odd.bytes();
  const std::uint8_t running = GENERATE(std::uint8_t{0}, std::uint8_t{1});
  DfuHost host(running);
  CHECK(host.download(bytes, 517).status == DfuStatus::kOk);
  CHECK(host.ready_with(odd, static_cast<std::uint8_t>(1 - running)));
  CHECK(host.slots.violations() == 0);
}

TEST_CASE("What must not be installed is refused before anything is erased, with the status that says why") {
  DfuHost host;
  host.slots.parts[1].overwrite(0, make_image({.version = "0.9.0", .slot = 1}).header_bytes);
  const Bytes before = host.cells(1);
  Bytes bad = file();
  DfuStatus expected = DfuStatus::kErrFile;
  SECTION("for another product") {
    bad = make_package({.product = "HS-2"}).bytes();
    expected = DfuStatus::kErrTarget;
  }
  SECTION("signed by a stranger") {
    bad = make_package({.signer = Signer::kStranger}).bytes();
  }
  SECTION("linked for another device's slots") {
    bad = make_package({.slot_bytes = 6 * 4096}).bytes();
  }
  SECTION("longer than the slot") {
    bad = make_package({.body_bytes = {20'000, 20'000}}).bytes();
  }
  SECTION("a step back") {
    bad = make_package({.counter = 0}).bytes();
  }
  SECTION("one bit of the image's header flipped") {
    bad[kImage1 + 40] ^= std::byte{1};
  }
  SECTION("no .scfw at all") {
    bad.assign(5000, std::byte{0x42});
  }
  SECTION("a bare image") {
    bad = host.cells(0);
  }
  SECTION("bytes between the images that are not zero") {
    bad[kImage1 - 1] = std::byte{1};
  }
  const auto end = host.download(bad, 1000);
  CHECK(end.state == State::kError);
  CHECK(end.status == expected);
  CHECK(host.cells(1) == before);
  CHECK(host.slots.parts[1].erases(0) == 0);
  // The device is not the worse for it.
  CHECK(host.download(file(), 1000).status == DfuStatus::kOk);
  CHECK(host.ready_with(package(), 1));
}

TEST_CASE(
    "A table with any bit flipped, or with sizes that do not add up, is refused before anything is erased") {
  for (std::size_t bit = 0; bit < 64 * 8; ++bit) {
    DfuHost host;
    Bytes bad = file();
    bad[bit / 8] ^= static_cast<std::byte>(1U << bit % 8);
    INFO("bit " << bit);
    REQUIRE(host.download(bad, 4096).status == DfuStatus::kErrFile);
    REQUIRE(host.slots.parts[1].erases(0) == 0);
  }
  // The same with a right checksum: every rule stands on its own. A wrong size of the image that is skipped
  // may only show in the offset of the next, so the other one is kept there.
  for (const std::size_t at : {0U, 4U, 6U, 8U, 12U, 16U, 20U, 24U, 28U, 32U, 59U}) {
    for (const int flip : {0x01, 0x40, 0x80}) {
      DfuHost host(at == 20U ? 1 : 0);
      Bytes bad = file();
      bad[at] ^= static_cast<std::byte>(flip);
      const std::uint32_t crc = scatter::protocol::crc32c(std::span(bad).first(60));
      scatter::protocol::store_le(bad.data() + 60, crc);
      INFO("offset " << at << ", bits " << flip);
      REQUIRE(host.download(bad, 4096).status == DfuStatus::kErrFile);
      REQUIRE(host.slots.parts[at == 20U ? 0 : 1].erases(0) == 0);
    }
  }
}

TEST_CASE("A truncated file is never ready, wherever it ends") {
  for (const std::size_t size : {1UL, 63UL, 64UL, 5000UL, kImage1, kImage1 + 255, kImage1 + 256,
                                 kImage1 + 5000, file().size() - 1, file().size() + 5, file().size() + 15}) {
    DfuHost host;
    Bytes cut = with_suffix(file());
    cut.resize(size);
    const auto end = host.download(cut, 4096);
    INFO("size " << size);
    CHECK(end.state == State::kError);
    CHECK(end.status == DfuStatus::kErrNotDone);
    CHECK_FALSE(host.ready_with(package(), 1));
    if (size < kImage1 + 256) {
      CHECK(host.slots.parts[1].erases(0) == 0);
    }
    CHECK(host.device->bus_reset() == DfuAfterReset::kRunTime);
  }
}

TEST_CASE("Bytes behind the file that are no DFU suffix are refused") {
  DfuHost host;
  Bytes more = with_suffix(file());
  SECTION("a seventeenth byte") {
    more.push_back(std::byte{0});
  }
  SECTION("sixteen others") {
    more[file().size() + 8] = std::byte{'V'};
  }
  const auto end = host.download(more, GENERATE(8U, 4096U));
  CHECK(end.status == DfuStatus::kErrFile);
  CHECK_FALSE(host.ready_with(package(), 1));
}

TEST_CASE("A body that is not the signed one is found at manifestation") {
  DfuHost host;
  Bytes bad = file();
  bad[kImage1 + 256 + GENERATE(0U, 4500U, 9000U)] ^= std::byte{0x10};
  const auto end = host.download(bad, 1000);
  CHECK(end.state == State::kError);
  CHECK(end.status == DfuStatus::kErrVerify);
  CHECK(read_marks(host.slots.parts[1]).last != MarkKind::kReady);
  CHECK(host.device->bus_reset() == DfuAfterReset::kRunTime);
}

TEST_CASE("Flash that fails is named: erasing and programming apart") {
  DfuHost host;
  SECTION("a unit that cannot be erased") {
    host.slots.parts[1].overwrite(0, make_image({.version = "0.9.0", .slot = 1}).header_bytes);
    host.slots.parts[1].overwrite(4096, make_image({}).body);
    host.slots.parts[1].wear_out(1);
    CHECK(host.download(file(), 1000).status == DfuStatus::kErrErase);
  }
  SECTION("a unit that does not keep what is programmed") {
    host.slots.parts[1].weaken(2);
    CHECK(host.download(file(), 1000).status == DfuStatus::kErrProg);
  }
  CHECK(host.device->state() == State::kError);
  CHECK_FALSE(host.ready_with(package(), 1));
}

TEST_CASE("ABORT in the middle leaves dfuIDLE; the same file resumes and another one starts anew") {
  DfuHost host;
  host.enter_dfu_mode();
  const std::size_t sent = kImage1 + 256 + 8000;
  REQUIRE(host.send(std::span(file()).first(sent), 4000).state == State::kDnloadIdle);
  REQUIRE_FALSE(host.ask(Code::kAbort).stall);
  CHECK(host.status()->state == State::kIdle);
  CHECK_FALSE(host.device->busy());
  const std::uint64_t first_unit = host.slots.parts[1].erases(0);
  SECTION("the same") {
    CHECK(host.download(file(), 64).status == DfuStatus::kOk);
    CHECK(host.ready_with(package(), 1));
    CHECK(host.slots.parts[1].erases(0) == first_unit);
  }
  SECTION("another") {
    const auto later = make_package({.version = "2.0.1"});
    CHECK(host.download(later.bytes(), 64).status == DfuStatus::kOk);
    CHECK(host.ready_with(later, 1));
    CHECK(host.slots.parts[1].erases(0) == first_unit + 1);
  }
  CHECK(host.slots.violations() == 0);
}

TEST_CASE("A download resumes at an erase unit, wherever that lies against the device's chunks") {
  // 4160 - 1024 is no multiple of 1024.
  DfuHost host(0, {.unit_bytes = 4160, .units = 5, .program_bytes = 32});
  host.slots.install(make_image({.slot_bytes = 5 * 4160}), {{MarkKind::kConfirmed, 1}});
  host.boot();
  const auto odd = make_package({.slot_bytes = 5 * 4160});
  const Bytes bytes = odd.bytes();
  host.enter_dfu_mode();
  REQUIRE(host.send(std::span(bytes).first(kImage1 + 256 + 8000), 1000).state == State::kDnloadIdle);
  host.boot();
  const std::uint64_t first_unit = host.slots.parts[1].erases(0);
  CHECK(host.download(bytes, 1000).status == DfuStatus::kOk);
  CHECK(host.slots.parts[1].erases(0) == first_unit);
  CHECK(host.ready_with(odd, 1));
  CHECK(host.slots.violations() == 0);
}

TEST_CASE("A file whose header is the same and whose body is not, is noticed when it resumes") {
  DfuHost host;
  host.enter_dfu_mode();
  REQUIRE(host.send(std::span(file()).first(kImage1 + 256 + 8000), 1000).state == State::kDnloadIdle);
  REQUIRE_FALSE(host.ask(Code::kAbort).stall);
  Bytes bad = file();
  bad[kImage1 + 256 + 100] ^= std::byte{1};
  CHECK(host.download(bad, 1000).status == DfuStatus::kErrVerify);
}

TEST_CASE("A download that somebody else disturbed between two blocks ends with errUNKNOWN") {
  DfuHost host;
  host.enter_dfu_mode();
  const std::size_t sent = kImage1 + 256 + 2000;
  REQUIRE(host.send(std::span(file()).first(sent), 4096).state == State::kDnloadIdle);
  REQUIRE(host.receiver->begin({}).status == scatter::protocol::StatusCode::kInvalidArgument);
  const auto number = static_cast<std::uint16_t>((sent + 4095) / 4096);
  CHECK(host.send(std::span(file()).subspan(sent), 4096, number).status == DfuStatus::kErrUnknown);
  CHECK_FALSE(host.ready_with(package(), 1));
}

TEST_CASE("An error while flash is erased stops the erasing, and the next download is free to begin") {
  DfuHost host;
  host.enter_dfu_mode();
  REQUIRE(host.send(std::span(file()).first(kImage1), 4096).state == State::kDnloadIdle);
  REQUIRE_FALSE(host.ask(Code::kDnload, 3, std::span(file()).subspan(kImage1, 300)).stall);
  for (int i = 0; i < 100 && !host.receiver->busy(); ++i) {
    host.device->poll();
  }
  REQUIRE(host.receiver->busy());
  SECTION("by a request that the state does not allow") {
    REQUIRE(host.ask(Code::kUpload).stall);
  }
  SECTION("by a bus reset") {
    REQUIRE(host.device->bus_reset() == DfuAfterReset::kRunTime);
  }
  CHECK_FALSE(host.receiver->busy());
  CHECK(host.download(file(), 1000).status == DfuStatus::kOk);
  CHECK(host.ready_with(package(), 1));
}

TEST_CASE("After a power cut at any operation a new download ends ready") {
  std::uint64_t operations = 0;
  {
    DfuHost whole;
    whole.slots.supply.disarm();
    REQUIRE(whole.download(file(), 4096).status == DfuStatus::kOk);
    operations = whole.slots.supply.operations();
  }
  REQUIRE(operations > 10);
  for (std::uint64_t at = 0; at < operations; ++at) {
    for (const CutKind kind : {CutKind::kTornPrefix, CutKind::kUnstable, CutKind::kTrap}) {
      DfuHost host;
      host.slots.supply.arm({.operation = at, .kind = kind, .detail = static_cast<std::uint32_t>(at)});
      (void)host.download(file(), 4096);
      INFO("cut at " << at << ", kind " << static_cast<int>(kind));
      REQUIRE(host.slots.supply.lost());
      host.boot();
      REQUIRE(host.download(file(), 1000).status == DfuStatus::kOk);
      REQUIRE(host.slots.violations() == 0);
      REQUIRE(host.ready_with(package(), 1));
    }
  }
}

TEST_CASE("A bus reset during a download stops it and loses nothing but the place") {
  DfuHost host;
  host.enter_dfu_mode();
  REQUIRE(host.send(std::span(file()).first(kImage1 + 5000), 1000).state == State::kDnloadIdle);
  REQUIRE_FALSE(host.ask(Code::kDnload, 15, std::span(file()).first(1000)).stall);
  CHECK(host.device->bus_reset() == DfuAfterReset::kRunTime);
  CHECK_FALSE(host.device->busy());
  CHECK(host.download(file(), 1000).status == DfuStatus::kOk);
  CHECK(host.ready_with(package(), 1));
}

TEST_CASE("In the bootloader DFU begins with errFIRMWARE and brings the device back") {
  DfuHost host(ImageSlots::kCount);
  CHECK(host.device->bus_reset() == DfuAfterReset::kDfuMode);
  CHECK(host.status()->state == State::kError);
  CHECK(host.status()->status == DfuStatus::kErrFirmware);
  CHECK(host.device->bus_reset() == DfuAfterReset::kDfuMode);
  CHECK(host.download(file(), 1000).status == DfuStatus::kOk);
  CHECK(host.device->bus_reset() == DfuAfterReset::kRestart);
  CHECK(decide(host.slots, host.verifier, DfuHost::kProduct, ResetReason::kRequested).action ==
        BootDecision::Action::kRun);
}

TEST_CASE(
    "While an update over the normal protocol is pending, or a trial is not confirmed, DFU says errVENDOR") {
  DfuHost host;
  SECTION("pending") {
    scatter::protocol::UpdateBegin message;
    const auto header = scatter::firmware_files::header_bytes(package().image(1).header);
    std::ranges::copy(header, message.header.begin());
    REQUIRE(host.receiver->begin(message).status == scatter::protocol::StatusCode::kPending);
  }
  SECTION("on trial") {
    host.slots.install(make_image({.version = "1.5.0", .slot = 0}),
                       {{MarkKind::kReady, 0}, {MarkKind::kTried, 0}});
    host.slots.install(make_image({.slot = 1}), {{MarkKind::kConfirmed, 1}});
    host.boot();
  }
  const Bytes before = host.cells(1);
  CHECK(host.download(file(), 1000).status == DfuStatus::kErrVendor);
  CHECK(host.cells(1) == before);
}

TEST_CASE("A file that is ready already is compared, not written again") {
  DfuHost host;
  REQUIRE(host.download(file(), 1000).status == DfuStatus::kOk);
  host.boot();
  host.slots.supply.disarm();
  CHECK(host.download(file(), 64).status == DfuStatus::kOk);
  CHECK(host.slots.supply.operations() == 0);
  CHECK(host.device->bus_reset() == DfuAfterReset::kRestart);
}
