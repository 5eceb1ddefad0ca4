#include <catch2/catch.hpp>

#include "firmware/core/persistent_state.h"
#include "tests/unit/firmware/fake_host.h"

using namespace scatter::firmware;
using namespace scatter::firmware::fake;
using namespace scatter::protocol;

namespace {

CalibrationManifest manifest(Target kind, std::uint8_t number) {
  CalibrationManifest m;
  m.kind = kind;
  m.id.fill(number);
  m.certificate_id = "WR-7";
  m.scalars.push_back(static_cast<float>(number));
  return m;
}

struct Store {
  explicit Store(FakeFlash& flash) : state(flash, factory.data) { state.mount(); }
  FakeFactory factory;
  PersistentState state;
};

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
  CHECK(store.state.recovered() == 0);
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

TEST_CASE("A full half moves its live records to the other one; the last two of every kind live on") {
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

TEST_CASE("After each of many commits a restart finds the same manifests: moving halves forgets nothing") {
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

TEST_CASE("A torn last record at any byte leaves every earlier one, is reported, and can be written past") {
  FakeFlash before;
  {
    Store store(before);
    REQUIRE(store.state.commit(manifest(Target::kWhiteReference, 1)) == StatusCode::kOk);
  }
  FakeFlash after = before;
  {
    Store store(after);  // Boot record and one more manifest behind the first.
    REQUIRE(store.state.commit(manifest(Target::kWhiteReference, 2)) == StatusCode::kOk);
  }
  std::vector<std::size_t> changed;
  for (std::size_t i = 0; i < after.cells.size(); ++i) {
    if (after.cells[i] != before.cells[i]) {
      changed.push_back(i);
    }
  }
  REQUIRE(!changed.empty());
  for (const std::size_t cut : changed) {
    FakeFlash torn = after;
    std::fill(torn.cells.begin() + static_cast<std::ptrdiff_t>(cut), torn.cells.end(), std::byte{0xFF});
    {
      Store store(torn);
      REQUIRE(store.state.mounted());
      const std::uint8_t id = store.state.calibrations().current_id(Target::kWhiteReference)[0];
      REQUIRE(id == 1);
      REQUIRE(store.state.commit(manifest(Target::kWhiteReference, 9)) == StatusCode::kOk);
    }
    Store again(torn);
    REQUIRE(again.state.calibrations().current_id(Target::kWhiteReference)[0] == 9);
    REQUIRE(torn.violations == 0);
  }
}

TEST_CASE("A flipped bit anywhere in the log costs at most one record and is counted") {
  FakeFlash good;
  {
    Store store(good);
    for (std::uint8_t i = 1; i <= 4; ++i) {
      REQUIRE(store.state.commit(manifest(static_cast<Target>(i), i)) == StatusCode::kOk);
    }
  }
  for (std::size_t byte = 16; byte < 700; byte += 3) {
    FakeFlash flash = good;
    flash.cells[byte] ^= std::byte{0x10};
    if (flash.cells[byte] == std::byte{0xEF}) {
      continue;  // Was erased.
    }
    Store store(flash);
    REQUIRE(store.state.mounted());
    REQUIRE(store.state.calibrations().list().manifests.size() >= 3);
    REQUIRE(store.state.recovered() == 1);
  }
}

TEST_CASE("A flash that fails at any operation keeps the old set and says so") {
  for (std::uint32_t fail = 0; fail < 40; ++fail) {
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
  }
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
