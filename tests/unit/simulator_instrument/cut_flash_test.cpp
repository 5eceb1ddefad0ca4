#include <catch2/catch.hpp>

#include <algorithm>
#include <array>
#include <set>
#include <vector>

#include "simulator/faults/cut_flash.h"

using scatter::firmware::Flash;
using scatter::simulator::CutFlash;
using scatter::simulator::CutKind;
using scatter::simulator::PowerCut;
using scatter::simulator::Supply;

namespace {

// Units that are no multiple of the model's own pages, so that those are crossed.
constexpr Flash::Geometry kGeometry{.unit_bytes = 1536, .units = 4, .program_bytes = 32};
constexpr std::uint32_t kBytes = 4 * 1536;

std::vector<std::byte> pattern(std::size_t size, std::uint8_t seed = 0) {
  std::vector<std::byte> bytes(size);
  for (std::size_t i = 0; i < size; ++i) {
    bytes[i] = static_cast<std::byte>((i * 7 + seed) % 251);
  }
  return bytes;
}

std::vector<std::byte> read(CutFlash& flash, std::uint32_t offset, std::size_t size) {
  std::vector<std::byte> bytes(size);
  REQUIRE(flash.read(offset, bytes));
  return bytes;
}

bool reads_erased(CutFlash& flash, std::uint32_t offset, std::size_t size) {
  const auto bytes = read(flash, offset, size);
  return std::ranges::all_of(bytes, [](std::byte b) { return b == std::byte{0xFF}; });
}

struct Part {
  Supply supply;
  CutFlash flash{kGeometry, supply};
};

/// One cut program of `bytes` at 1024 - 32, after which the power is on again.
void cut_program(Part& part, CutKind kind, std::uint32_t detail, const std::vector<std::byte>& bytes) {
  part.supply.arm({.operation = 0, .kind = kind, .detail = detail});
  CHECK_FALSE(part.flash.program(992, bytes));
  CHECK(part.supply.lost());
  part.supply.power_on();
}

void cut_erase(Part& part, CutKind kind, std::uint32_t detail) {
  REQUIRE(part.flash.program(1536, pattern(1536)));
  part.supply.arm({.operation = 0, .kind = kind, .detail = detail});
  CHECK_FALSE(part.flash.erase(1));
  part.supply.power_on();
}

}  // namespace

TEST_CASE("A strict flash keeps what is programmed and erases by unit") {
  Part part;
  CHECK(reads_erased(part.flash, 0, kBytes));
  REQUIRE(part.flash.program(1504, pattern(96)));
  CHECK(read(part.flash, 1504, 96) == pattern(96));
  REQUIRE(part.flash.erase(0));
  CHECK(reads_erased(part.flash, 1504, 32));
  const auto written = pattern(96);
  CHECK(read(part.flash, 1536, 64) == std::vector(written.begin() + 32, written.end()));
  CHECK(part.flash.erases(0) == 1);
  CHECK(part.flash.erases(1) == 0);
  CHECK(part.flash.violations() == 0);
  CHECK(part.supply.operations() == 2);
}

TEST_CASE("Every forbidden call is a violation that says what it was") {
  const auto violation_of = [](auto&& call) {
    Part part;
    REQUIRE(part.flash.program(0, pattern(32)));
    CHECK_FALSE(call(part.flash));
    CHECK(part.flash.violations() == 1);
    CHECK(read(part.flash, 0, 32) == pattern(32));
    return part.flash.violation();
  };
  CHECK(violation_of([](CutFlash& f) { return f.program(0, pattern(32)); }) ==
        "program of 32 B at 0: cell 0 is not erased");
  CHECK(violation_of([](CutFlash& f) { return f.program(16, pattern(32)); }) ==
        "program of 32 B at 16: part 6144 B, granule 32 B");
  CHECK(violation_of([](CutFlash& f) { return f.program(32, pattern(31)); }) ==
        "program of 31 B at 32: part 6144 B, granule 32 B");
  CHECK(violation_of([](CutFlash& f) { return f.program(kBytes, pattern(32)); }) ==
        "program of 32 B at 6144: part 6144 B, granule 32 B");
  CHECK(violation_of([](CutFlash& f) { return f.erase(4); }) == "erase of unit 4: the part has 4");
  CHECK(violation_of([](CutFlash& f) {
          std::array<std::byte, 2> out{};
          return f.read(kBytes - 1, out);
        }) == "read of 2 B at 6143 leaves the part of 6144 B");
}

TEST_CASE("After the cut nothing has an effect until the power is back") {
  Part part;
  REQUIRE(part.flash.program(0, pattern(32)));
  part.supply.arm({.operation = 1, .kind = CutKind::kBefore});
  REQUIRE(part.flash.program(32, pattern(32)));
  CHECK_FALSE(part.flash.program(64, pattern(32)));
  CHECK_FALSE(part.flash.program(96, pattern(32)));
  CHECK_FALSE(part.flash.erase(0));
  std::array<std::byte, 1> out{};
  CHECK_FALSE(part.flash.read(0, out));
  part.supply.power_on();
  CHECK(read(part.flash, 0, 32) == pattern(32));
  CHECK(read(part.flash, 32, 32) == pattern(32));
  CHECK(reads_erased(part.flash, 64, 64));
  CHECK(part.flash.violations() == 0);
}

TEST_CASE("A torn program leaves a prefix, at most one byte that lacks bits, and erased cells") {
  const auto wanted = pattern(1056);
  std::set<std::size_t> lengths;
  for (std::uint32_t detail = 0; detail < 50; ++detail) {
    Part part;
    cut_program(part, CutKind::kTornPrefix, detail, wanted);
    const auto found = read(part.flash, 992, wanted.size());
    const auto torn = static_cast<std::size_t>(std::ranges::mismatch(found, wanted).in1 - found.begin());
    REQUIRE(torn < wanted.size());
    CHECK((found[torn] & wanted[torn]) == wanted[torn]);  // Only bits that are still 1 differ.
    CHECK(std::all_of(found.begin() + static_cast<std::ptrdiff_t>(torn) + 1, found.end(),
                      [](std::byte b) { return b == std::byte{0xFF}; }));
    lengths.insert(torn);
  }
  CHECK(lengths.size() > 40);
}

TEST_CASE("A half-done operation leaves every cell between old and new, the same at every power-on") {
  Part part;
  const auto wanted = pattern(1056);
  cut_program(part, CutKind::kHalfErased, 3, wanted);
  const auto found = read(part.flash, 992, wanted.size());
  CHECK(found != wanted);
  for (std::size_t i = 0; i < wanted.size(); ++i) {
    CHECK((found[i] & wanted[i]) == wanted[i]);
  }
  part.supply.power_on();
  CHECK(read(part.flash, 992, wanted.size()) == found);

  Part other;
  cut_erase(other, CutKind::kHalfErased, 3);
  const auto old = pattern(1536);
  const auto half = read(other.flash, 1536, 1536);
  CHECK(half != old);
  for (std::size_t i = 0; i < old.size(); ++i) {
    CHECK((half[i] & old[i]) == old[i]);
  }
}

TEST_CASE("A torn erase clears a prefix; one cut after its end clears all; one cut before it nothing") {
  Part torn;
  cut_erase(torn, CutKind::kTornPrefix, 5);
  const auto found = read(torn.flash, 1536, 1536);
  const auto old = pattern(1536);
  std::size_t first_old = 1536;
  while (first_old > 0 && found[first_old - 1] == old[first_old - 1]) {
    --first_old;
  }
  CHECK(first_old < 1536);
  CHECK(reads_erased(torn.flash, 1536, first_old));
  Part after;
  cut_erase(after, CutKind::kAfter, 0);
  CHECK(reads_erased(after.flash, 1536, 1536));
  Part before;
  cut_erase(before, CutKind::kBefore, 0);
  CHECK(read(before.flash, 1536, 1536) == old);
}

TEST_CASE("Unstable cells read as old, as new and as mixtures, drawn anew at each power-on only") {
  Part part;
  const auto wanted = pattern(1056);
  cut_program(part, CutKind::kUnstable, 1, wanted);
  bool all_old = false;
  bool all_new = false;
  bool mixed = false;
  for (int i = 0; i < 40; ++i) {
    const auto found = read(part.flash, 992, wanted.size());
    CHECK(read(part.flash, 992, wanted.size()) == found);
    const bool is_old = reads_erased(part.flash, 992, wanted.size());
    all_old = all_old || is_old;
    all_new = all_new || found == wanted;
    mixed = mixed || (!is_old && found != wanted);
    part.supply.power_on();
  }
  CHECK(all_old);
  CHECK(all_new);
  CHECK(mixed);
  part.supply.power_on();
  REQUIRE(part.flash.erase(0));
  REQUIRE(part.flash.erase(1));
  for (int i = 0; i < 10; ++i) {
    CHECK(reads_erased(part.flash, 992, wanted.size()));
    part.supply.power_on();
  }
}

TEST_CASE("Programming unstable cells that read erased either makes them sound or fails and is noticed") {
  int sound = 0;
  int failed = 0;
  for (std::uint32_t detail = 0; detail < 200; ++detail) {
    Part part;
    cut_program(part, CutKind::kUnstable, detail, pattern(64));
    if (!reads_erased(part.flash, 992, 64)) {
      continue;
    }
    if (part.flash.program(992, pattern(64, 9))) {
      ++sound;
      for (int i = 0; i < 5; ++i) {
        CHECK(read(part.flash, 992, 64) == pattern(64, 9));
        part.supply.power_on();
      }
    } else {
      ++failed;
      std::array<std::byte, 1> out{};
      CHECK_FALSE(part.flash.read(992, out));
    }
    CHECK(part.flash.violations() == 0);
  }
  CHECK(sound > 5);
  CHECK(failed > 5);
}

TEST_CASE("Trapping cells cannot be read, whatever else the read covers, until they are erased") {
  Part part;
  cut_program(part, CutKind::kTrap, 1, pattern(64));
  std::array<std::byte, 33> out{};
  CHECK_FALSE(part.flash.read(992, std::span(out).first(1)));
  CHECK_FALSE(part.flash.read(960, out));
  CHECK(part.flash.read(960, std::span(out).first(32)));
  CHECK_FALSE(part.flash.program(992, pattern(32)));
  CHECK(part.flash.violations() == 1);
  REQUIRE(part.flash.erase(0));
  CHECK(reads_erased(part.flash, 0, 1536));
}

TEST_CASE("Worn units refuse without effect; rot and traps can be put anywhere") {
  Part part;
  REQUIRE(part.flash.program(0, pattern(32)));
  part.flash.wear_out(0);
  CHECK_FALSE(part.flash.erase(0));
  CHECK_FALSE(part.flash.program(32, pattern(32)));
  CHECK(read(part.flash, 0, 32) == pattern(32));
  CHECK(reads_erased(part.flash, 32, 32));
  CHECK(part.flash.violations() == 0);
  part.flash.rot(5, 0x81);
  CHECK(read(part.flash, 5, 1)[0] == (pattern(32)[5] ^ std::byte{0x81}));
  part.flash.trap(7, 1);
  std::array<std::byte, 1> out{};
  CHECK_FALSE(part.flash.read(7, out));
  part.flash.overwrite(7, pattern(1, 77));
  CHECK(read(part.flash, 7, 1) == pattern(1, 77));
}

TEST_CASE("A weak unit says that it programmed and did not") {
  Part part;
  part.flash.weaken(1);
  const std::vector<std::byte> zeros(32);
  REQUIRE(part.flash.program(1504, zeros));
  REQUIRE(part.flash.program(1536, zeros));
  CHECK(read(part.flash, 1504, 32) == zeros);
  CHECK(read(part.flash, 1536, 32) != zeros);
}

TEST_CASE("A copy of a flash on its own supply goes its own way") {
  Part part;
  REQUIRE(part.flash.program(0, pattern(32)));
  Supply supply = part.supply;
  CutFlash copy(part.flash, supply);
  REQUIRE(copy.program(32, pattern(32)));
  supply.arm({.operation = 0, .kind = CutKind::kBefore});
  CHECK_FALSE(copy.erase(0));
  CHECK(supply.lost());
  CHECK_FALSE(part.supply.lost());
  CHECK(reads_erased(part.flash, 32, 32));
  REQUIRE(part.flash.erase(0));
  supply.power_on();
  CHECK(read(copy, 0, 32) == pattern(32));
}

TEST_CASE("Two parts on one supply lose it together and share the count of operations") {
  Supply supply;
  CutFlash first(kGeometry, supply);
  CutFlash second(kGeometry, supply);
  supply.arm({.operation = 1, .kind = CutKind::kBefore});
  REQUIRE(first.program(0, pattern(32)));
  CHECK_FALSE(second.erase(0));
  CHECK_FALSE(first.erase(0));
  CHECK(supply.operations() == 2);
}
