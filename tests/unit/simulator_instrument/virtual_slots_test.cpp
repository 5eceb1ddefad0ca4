#include <catch2/catch.hpp>

#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <vector>

#include "firmware/backplane/shared_memory.h"
#include "firmware/image/marks.h"
#include "simulator/instrument/tmp105.h"
#include "simulator/instrument/virtual_board.h"
#include "simulator/instrument/virtual_slots.h"

using namespace scatter;
using namespace scatter::simulator;
using firmware::BootDecision;
using protocol::ResetReason;
using protocol::SlotVerdict;

TEST_CASE("A new simulated instrument runs version 0.1.0 from slot 0, confirmed") {
  FlashImage flash;
  VirtualSlots slots(flash, "HS-1 test");
  CHECK(slots.decision().action == BootDecision::Action::kRun);
  CHECK(slots.running() == 0);
  CHECK_FALSE(slots.decision().trial);
  CHECK(slots.decision().verdicts[0] == SlotVerdict::kConfirmed);
  CHECK(slots.decision().verdicts[1] == SlotVerdict::kEmpty);
  CHECK(slots.decision().lowest_counter == 1);
  CHECK(slots.build_id() == "openscatter 0.1.0");
  CHECK(flash.violations() == 0);
}

TEST_CASE("Slots lie where those of the emulated board lie, so that one image fits both") {
  using namespace firmware::backplane;
  for (std::uint8_t i = 0; i < 2; ++i) {
    CHECK(kSlotAddress[i] == kSharedMemoryAddress + kSlotOffset[i]);
  }
  CHECK(FlashImage::kSlotGeometry.unit_bytes == kSlotUnitBytes);
  CHECK(FlashImage::kSlotGeometry.unit_bytes * FlashImage::kSlotGeometry.units == kSlotBytes);
  CHECK(FlashImage::kSlotGeometry.program_bytes == kSlotGranuleBytes);
}

TEST_CASE("Without a good image the simulated instrument starts in rescue mode") {
  FlashImage flash;
  VirtualSlots slots(flash, "HS-1 test");
  REQUIRE(slots.slot(0).erase(0));
  slots.boot(ResetReason::kPowerOn);
  CHECK(slots.decision().action == BootDecision::Action::kRescue);
  CHECK(slots.build_id() == "bootloader 0.1.0");
}

TEST_CASE("A flash file of an older simulator keeps what it held and gets slots") {
  const auto path = std::filesystem::temp_directory_path() / ("scatter_slots_" + std::to_string(::getpid()));
  {
    std::vector<char> old(256 * 1024, '\xFF');
    old[100] = 'x';
    std::ofstream(path, std::ios::binary).write(old.data(), static_cast<std::streamsize>(old.size()));
  }
  {
    auto flash = FlashImage::open(path);
    REQUIRE(flash.has_value());
    VirtualSlots slots(**flash, "HS-1 test");
    CHECK(slots.running() == 0);
    CHECK((*flash)->bytes()[100] == std::byte{'x'});
    REQUIRE(firmware::write_mark(slots.slot(0), firmware::MarkKind::kConfirmed, 9));
  }
  auto again = FlashImage::open(path);
  REQUIRE(again.has_value());
  CHECK(firmware::read_marks((*again)->slot(0)).number == 9);
  VirtualSlots slots(**again, "HS-1 test");
  CHECK(slots.running() == 0);
  std::filesystem::remove(path);
}

TEST_CASE("Thermometers read in sixteenths of a kelvin, as the TMP105 of the emulated board does") {
  // 25.0 C is 0x1900 in the chip's register: 400 sixteenths.
  CHECK(tmp105_register(25'000) == 0x1900);
  CHECK(tmp105_mK(0x1900) == 298'150);
  // 25.1 C: 25.1 * 256 = 6425.6, down to 6416 = 401 sixteenths = 25.0625 C, in whole mK 25062.
  CHECK(tmp105_register(25'100) == 6416);
  CHECK(tmp105_reading_mK(273'150 + 25'100) == 273'150 + 25'062);
  // -0.1 C: -25.6, towards zero -25, then the low bits cleared: -32 = -2 sixteenths = -0.125 C.
  CHECK(tmp105_register(-100) == -32);
  CHECK(tmp105_reading_mK(273'150 - 100) == 273'150 - 125);
  for (std::int32_t temperature = -20'000; temperature < 60'000; temperature += 7) {
    const std::int32_t off = tmp105_reading_mK(kIcePoint_mK + temperature) - (kIcePoint_mK + temperature);
    // At most one step of 62.5 mK down; below freezing, rounding 1/256 K towards zero may go up by 3.9 mK.
    CHECK((off > -64 && off <= (temperature < 0 ? 4 : 0)));
  }
}
