#include <catch2/catch.hpp>

#include <algorithm>
#include <cstring>
#include <string>
#include <utility>
#include <vector>

#include "firmware/core/persistent_state.h"
#include "protocol/crc.h"
#include "protocol/endian.h"
#include "tests/unit/firmware/fake_host.h"

using namespace scatter::firmware;
using namespace scatter::firmware::fake;
using namespace scatter::protocol;

namespace {

constexpr std::size_t kCopyBytes = std::size_t{FakeFlash::kUnit} * FakeFlash::kUnits / 2;

CalibrationManifest manifest(Target kind, std::uint8_t number) {
  CalibrationManifest m;
  m.kind = kind;
  m.id.fill(number);
  m.certificate_id = "WR-7";
  m.scalars.push_back(static_cast<float>(number));
  return m;
}

struct Store {
  explicit Store(Flash& flash) : state(flash, factory.data) { state.mount(); }
  FakeFactory factory;
  PersistentState state;
};

using Condition = StoreReport::Condition;

/// Where the record with the highest number begins in a copy: the layout of record_store.h, read anew.
std::size_t newest_record(const FakeFlash& flash, std::size_t copy) {
  std::size_t found = flash.cells.size();
  std::uint64_t highest = 0;
  for (std::size_t at = copy * kCopyBytes; at + 24 <= (copy + 1) * kCopyBytes; at += 8) {
    const std::byte* const bytes = flash.cells.data() + at;
    if (std::memcmp(bytes, "OSRC", 4) == 0 && load_le<std::uint64_t>(bytes + 8) > highest) {
      highest = load_le<std::uint64_t>(bytes + 8);
      found = at;
    }
  }
  REQUIRE(found < flash.cells.size());
  return found;
}

}  // namespace

TEST_CASE("Manifests, settings and boot count survive a power cycle; nothing is programmed twice") {
  FakeFlash flash;
  {
    Store store(flash);
    CHECK(store.state.boot_count() == 1);
    CHECK(store.state.commit(manifest(Target::kWhiteReference, 1)) == StatusCode::kOk);
    CHECK(store.state.commit(manifest(Target::kWhiteReference, 2)) == StatusCode::kOk);
    CHECK(store.state.commit(manifest(Target::kDarkCap, 3)) == StatusCode::kOk);
    CHECK(store.state.set({.key = "name", .value = "left bench"}) == StatusCode::kOk);
  }
  Store store(flash);
  CHECK(store.state.boot_count() == 2);
  CHECK(store.state.report().condition == Condition::kWhole);
  CHECK(store.state.report().whole_copies == 2);
  CHECK(fault_of(store.state.report()) == FaultCode::kNone);
  CHECK(store.state.settings().get("name")->value.str() == "left bench");
  const CalibrationListed listed = store.state.calibrations().list();
  REQUIRE(listed.manifests.size() == 3);
  CHECK(listed.manifests[0].id[0] == 3);  // Newest first.
  CHECK(listed.manifests[0].sequence == 3);
  CHECK(listed.manifests[2].id[0] == 1);
  CHECK(listed.manifests[1].certificate_id.str() == "WR-7");
  CHECK(flash.violations == 0);
}

TEST_CASE("Undo brings the previous manifest back, across a power cycle; restore forgets all") {
  FakeFlash flash;
  {
    Store store(flash);
    REQUIRE(store.state.commit(manifest(Target::kWhiteReference, 1)) == StatusCode::kOk);
    REQUIRE(store.state.commit(manifest(Target::kWhiteReference, 2)) == StatusCode::kOk);
    CHECK(store.state.undo(Target::kBlackReference) == StatusCode::kNotFound);
    CHECK(store.state.undo(Target::kWhiteReference) == StatusCode::kOk);
    CHECK(store.state.undo(Target::kWhiteReference) == StatusCode::kNotFound);
  }
  {
    Store store(flash);
    CHECK(store.state.calibrations().current_id(Target::kWhiteReference)[0] == 1);
    REQUIRE(store.state.commit(manifest(Target::kWhiteReference, 5)) == StatusCode::kOk);
    CHECK(store.state.calibrations().current(Target::kWhiteReference)->sequence == 3);  // Never used again.
    CHECK(store.state.restore_factory() == StatusCode::kOk);
  }
  Store store(flash);
  CHECK(store.state.calibrations().list().manifests.empty());
}

TEST_CASE("The ring goes round many times; the last two of every kind live on") {
  FakeFlash flash;
  std::uint32_t commits = 0;
  for (int boot = 0; boot < 10; ++boot) {
    Store store(flash);
    REQUIRE(store.state.mounted());
    CHECK(store.state.boot_count() == static_cast<std::uint32_t>(boot) + 1);
    for (int i = 0; i < 60; ++i) {
      const auto kind = static_cast<Target>(1 + i % 4);
      REQUIRE(store.state.commit(manifest(kind, static_cast<std::uint8_t>(++commits))) == StatusCode::kOk);
    }
  }
  Store store(flash);
  const CalibrationListed listed = store.state.calibrations().list();
  REQUIRE(listed.manifests.size() == 8);
  for (std::size_t i = 0; i < 8; ++i) {
    CHECK(listed.manifests[i].sequence == commits - i);
    CHECK(listed.manifests[i].id[0] == static_cast<std::uint8_t>(commits - i));
  }
  CHECK(flash.violations == 0);
}

TEST_CASE("After each of many commits a restart finds the same manifests") {
  FakeFlash flash;
  Store store(flash);
  REQUIRE(store.state.set({.key = "name", .value = "kept"}) == StatusCode::kOk);
  REQUIRE(store.state.commit(manifest(Target::kDarkCap, 200)) == StatusCode::kOk);
  for (std::uint8_t i = 1; i <= 150; ++i) {
    REQUIRE(store.state.commit(manifest(Target::kWhiteReference, i)) == StatusCode::kOk);
    FakeFlash copy = flash;
    Store later(copy);
    REQUIRE(later.state.calibrations().list().manifests == store.state.calibrations().list().manifests);
    REQUIRE(later.state.calibrations().current_id(Target::kDarkCap)[0] == 200);
    REQUIRE(later.state.settings().get("name")->value.str() == "kept");
    REQUIRE(later.state.boot_count() == 2);
  }
}

TEST_CASE("Everything at its longest fits: the store is never full") {
  FakeFlash flash;
  {
    Store store(flash);
    for (std::uint8_t i = 0; i < 8; ++i) {
      CalibrationManifest longest =
          manifest(static_cast<Target>(1 + i % 4), static_cast<std::uint8_t>(i + 1));
      longest.certificate_id = std::string_view(std::string(48, 'c'));
      longest.scalars.resize(6);
      REQUIRE(store.state.commit(longest) == StatusCode::kOk);
    }
    const std::string text(64, 't');
    REQUIRE(store.state.set({.key = "name", .value = std::string_view(text)}) == StatusCode::kOk);
    REQUIRE(store.state.set({.key = "location", .value = std::string_view(text)}) == StatusCode::kOk);
  }
  Store store(flash);
  CHECK(store.state.calibrations().list().manifests.size() == 8);
  CHECK(store.state.settings().get("location")->value.str().size() == 64);
}

TEST_CASE("A flipped bit anywhere in the newest record of one copy costs nothing and is reported") {
  FakeFlash good;
  {
    Store store(good);
    for (std::uint8_t i = 1; i <= 4; ++i) {
      REQUIRE(store.state.commit(manifest(static_cast<Target>(i), i)) == StatusCode::kOk);
    }
  }
  for (std::size_t copy = 0; copy < 2; ++copy) {
    const std::size_t record = newest_record(good, copy);
    const std::uint32_t payload = load_le<std::uint32_t>(good.cells.data() + record + 16);
    const std::size_t body = (24 + payload + 7) / 8 * 8;  // The fake flash has granules of 8 bytes.
    for (std::size_t i = 0; i < body + 8; ++i) {
      FakeFlash flash = good;
      flash.cells[record + i] ^= std::byte{0x10};
      Store store(flash);
      INFO("copy " << copy + 1 << ", byte " << i);
      REQUIRE(store.state.mounted());
      REQUIRE(store.state.calibrations().list().manifests.size() == 4);
      REQUIRE(store.state.report().condition == Condition::kRecovered);
      REQUIRE(store.state.report().copy_used == 2 - copy);
      REQUIRE(store.state.report().copy_mended == copy + 1);
      REQUIRE(store.state.report().damaged == 1);
      REQUIRE(store.state.report().whole_copies == 2);
    }
  }
}

TEST_CASE(
    "When the newest record rots in both copies the one before it is in force, whole, and that is said") {
  FakeFlash flash;
  {
    Store store(flash);
    REQUIRE(store.state.commit(manifest(Target::kWhiteReference, 1)) == StatusCode::kOk);
    REQUIRE(store.state.commit(manifest(Target::kWhiteReference, 2)) == StatusCode::kOk);
  }
  flash.cells[newest_record(flash, 0) + 40] ^= std::byte{1};
  flash.cells[newest_record(flash, 1) + 40] ^= std::byte{1};
  Store store(flash);
  CHECK(store.state.calibrations().current_id(Target::kWhiteReference)[0] == 1);
  CHECK(store.state.calibrations().list().manifests.size() == 1);
  CHECK(fault_of(store.state.report()) == FaultCode::kCalibrationStoreRecovered);
  CHECK(text_of(store.state.report()).str() ==
        "store: 2 unfinished or damaged records dropped; both copies are whole");
}

TEST_CASE("The commit granule is programmed last, once what it commits reads back right") {
  struct WatchedFlash final : Flash {
    FakeFlash inside;
    std::vector<std::pair<std::uint32_t, std::size_t>> programs;
    std::vector<std::size_t> read_before;  ///< Bytes read between a program and the one before it.
    std::size_t reading = 0;
    Geometry geometry() noexcept override { return inside.geometry(); }
    bool read(std::uint32_t offset, std::span<std::byte> out) noexcept override {
      reading += out.size();
      return inside.read(offset, out);
    }
    bool program(std::uint32_t offset, std::span<const std::byte> bytes) noexcept override {
      programs.emplace_back(offset, bytes.size());
      read_before.push_back(std::exchange(reading, 0));
      return inside.program(offset, bytes);
    }
    bool erase(std::uint32_t unit) noexcept override { return inside.erase(unit); }
  };
  WatchedFlash flash;
  Store store(flash);
  REQUIRE(store.state.commit(manifest(Target::kDarkCap, 1)) == StatusCode::kOk);
  REQUIRE(flash.programs.size() == 8);  // Body and granule, two copies, two records.
  for (std::size_t i = 0; i < 8; i += 2) {
    const auto [body, length] = flash.programs[i];
    CHECK(std::memcmp(flash.inside.cells.data() + body, "OSRC", 4) == 0);
    CHECK(flash.programs[i + 1] == std::pair(static_cast<std::uint32_t>(body + length), std::size_t{8}));
    CHECK(flash.read_before[i + 1] == length);
  }
}

TEST_CASE("Two programs that went wrong in silence cost nothing that was confirmed") {
  struct LyingFlash final : Flash {
    FakeFlash inside;
    std::uint32_t programs = 0;
    std::uint32_t lies[2]{0xFFFF'FFFF, 0xFFFF'FFFF};
    Geometry geometry() noexcept override { return inside.geometry(); }
    bool read(std::uint32_t offset, std::span<std::byte> out) noexcept override {
      return inside.read(offset, out);
    }
    bool program(std::uint32_t offset, std::span<const std::byte> bytes) noexcept override {
      const bool lie = programs == lies[0] || programs == lies[1];
      ++programs;
      std::vector<std::byte> cells(bytes.begin(), bytes.end());
      cells[0] |= lie ? std::byte{0xFF} : std::byte{0};
      return inside.program(offset, cells);
    }
    bool erase(std::uint32_t unit) noexcept override { return inside.erase(unit); }
  };
  for (std::uint32_t first = 0; first < 12; ++first) {
    for (std::uint32_t second = first + 1; second < 12; ++second) {
      LyingFlash flash;
      flash.lies[0] = first;
      flash.lies[1] = second;
      {
        Store store(flash);
        REQUIRE(store.state.commit(manifest(Target::kDarkCap, 1)) == StatusCode::kOk);
        REQUIRE(store.state.commit(manifest(Target::kDarkCap, 2)) == StatusCode::kOk);
      }
      Store store(flash);
      INFO("programs " << first << " and " << second);
      CHECK(store.state.calibrations().current_id(Target::kDarkCap)[0] == 2);
      CHECK(store.state.calibrations().list().manifests.size() == 2);
    }
  }
}

TEST_CASE("A flash that fails at any operation keeps the last set that was stored and says so") {
  for (std::uint32_t fail = 0; fail < 60; ++fail) {
    FakeFlash flash;
    {
      Store store(flash);
      REQUIRE(store.state.commit(manifest(Target::kWhiteReference, 1)) == StatusCode::kOk);
    }
    std::uint8_t last = 1;
    {
      flash.fail_after = flash.operations + fail;
      Store store(flash);
      for (std::uint8_t i = 2; i < 80; ++i) {
        if (store.state.commit(manifest(Target::kWhiteReference, i)) != StatusCode::kOk) {
          break;
        }
        last = i;
        REQUIRE(store.state.calibrations().current_id(Target::kWhiteReference)[0] == i);
      }
    }
    flash.fail_after = 0xFFFF'FFFF;
    Store store(flash);
    REQUIRE(store.state.calibrations().current_id(Target::kWhiteReference)[0] == last);
    REQUIRE(flash.violations == 0);
  }
}

TEST_CASE("What was stored is served when the flash can no longer be written; changes are refused") {
  FakeFlash flash;
  {
    Store store(flash);
    REQUIRE(store.state.commit(manifest(Target::kWhiteReference, 1)) == StatusCode::kOk);
  }
  flash.fail_after = 0;
  Store store(flash);
  CHECK_FALSE(store.state.mounted());
  CHECK(fault_of(store.state.report()) == FaultCode::kFlashWrite);
  CHECK(store.state.calibrations().current_id(Target::kWhiteReference)[0] == 1);
  CHECK(store.state.commit(manifest(Target::kWhiteReference, 2)) == StatusCode::kResourceExhausted);
  CHECK(store.state.calibrations().current_id(Target::kWhiteReference)[0] == 1);
}

TEST_CASE("The store of a later version is left untouched and changes are refused, even beside our own") {
  FakeFlash flash;
  {
    Store store(flash);
    REQUIRE(store.state.commit(manifest(Target::kWhiteReference, 1)) == StatusCode::kOk);
  }
  // A header as a later firmware writes it, at the start of an erase unit.
  std::byte* const header = flash.cells.data() + FakeFlash::kUnit;
  std::memcpy(header, flash.cells.data() + newest_record(flash, 0), 24);
  store_le(header + 4, std::uint16_t{2});
  store_le(header + 20, crc32c(std::span<const std::byte>(header, 20)));
  const std::vector<std::byte> before = flash.cells;
  const std::uint32_t operations = flash.operations;
  Store store(flash);
  CHECK(fault_of(store.state.report()) == FaultCode::kStoreOfLaterVersion);
  CHECK(store.state.commit(manifest(Target::kWhiteReference, 2)) == StatusCode::kFailedPrecondition);
  CHECK(store.state.restore_factory() == StatusCode::kFailedPrecondition);
  CHECK(store.state.set({.key = "name", .value = "x"}) == StatusCode::kFailedPrecondition);
  CHECK(store.state.settings().get("name")->value.empty());
  CHECK(store.state.calibrations().list().manifests.empty());
  CHECK(flash.operations == operations);
  CHECK(flash.cells == before);
}

TEST_CASE("A flash too small for four places is refused, not used by halves") {
  struct SmallFlash final : Flash {
    FakeFlash inside;
    Geometry its{};
    Geometry geometry() noexcept override { return its; }
    bool read(std::uint32_t offset, std::span<std::byte> out) noexcept override {
      return inside.read(offset, out);
    }
    bool program(std::uint32_t offset, std::span<const std::byte> bytes) noexcept override {
      return inside.program(offset, bytes);
    }
    bool erase(std::uint32_t unit) noexcept override {
      std::fill_n(inside.cells.begin() + unit * its.unit_bytes, its.unit_bytes, std::byte{0xFF});
      return true;
    }
  };
  const Flash::Geometry refused[] = {{0, 0, 0},      {4096, 3, 8},  {1024, 7, 8}, {4096, 4, 0},
                                     {4096, 4, 128}, {4096, 4, 24}, {0, 4, 8},    {4096, 0xFFFF'FFFF, 8}};
  for (const Flash::Geometry& geometry : refused) {
    SmallFlash flash;
    flash.its = geometry;
    Store store(flash);
    CHECK_FALSE(store.state.mounted());
    CHECK(store.state.commit(manifest(Target::kDarkCap, 1)) == StatusCode::kResourceExhausted);
    CHECK(flash.inside.operations == 0);
  }
  SmallFlash flash;
  flash.its = {1024, 8, 8};
  CHECK(Store(flash).state.mounted());
}

TEST_CASE("A device without usable flash runs on and refuses to store") {
  FakeBoard board;
  board.flash.fail_after = 0;
  FakeHost host(board);
  host.hello();
  const auto begun = host.ask(CalibrationBegin{}).as<CalibrationBegun>();
  CalibrationCommit commit{.session = begun.session, .manifest = manifest(Target::kDarkCap, 1)};
  CHECK(host.status_of(commit) == StatusCode::kResourceExhausted);
  host.settle();
  REQUIRE(!host.all<FaultEvent>().empty());
  CHECK(host.all<FaultEvent>()[0].fault == static_cast<std::uint16_t>(FaultCode::kFlashWrite));
  host.measure(fixed_recipe());
}

TEST_CASE("The host is told at HELLO what the store recovered") {
  FakeBoard board;
  {
    Store store(board.flash);
  }
  board.flash.cells[newest_record(board.flash, 1) + 30] ^= std::byte{4};
  FakeHost host(board);
  host.hello();
  host.settle();
  REQUIRE(!host.all<FaultEvent>().empty());
  const FaultEvent fault = host.all<FaultEvent>()[0];
  CHECK(fault.fault == static_cast<std::uint16_t>(FaultCode::kCalibrationStoreRecovered));
  CHECK(
      fault.text.str() ==
      "store: 1 unfinished or damaged records dropped; copy 2 mended from the other; both copies are whole");
}
