// The board's drivers, each against what its port promises: clock, alarm, EEPROM, thermometers, slots.
// Register r1 of the test is the letter that comes over the host's line: 'e' with an EEPROM, 'n' without.
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "firmware/boards/mps2_an500/devices.h"
#include "firmware/boards/mps2_an500/eeprom.h"
#include "firmware/boards/mps2_an500/i2c_bus.h"
#include "firmware/boards/mps2_an500/registers.h"
#include "firmware/boards/mps2_an500/sleep.h"
#include "firmware/boards/mps2_an500/slots.h"
#include "firmware/boards/mps2_an500/startup.h"
#include "firmware/boards/mps2_an500/thermometers.h"
#include "tests/firmware_arm/semihosting.h"

namespace scatter::firmware::mps2_an500 {
namespace {

using semihosting::check;

// The data sheet's examples (TMP105, table 5): 25 deg C = 0x190, -0.25 = 0xFFC, both left-aligned.
static_assert(tmp105_mK(0x1900) == 298'150);
static_assert(tmp105_mK(0xFFC0) == 272'900);
static_assert(tmp105_mK(0x7FF0) == 273'150 + 127'937);

void check_clock() noexcept {
  BoardClock clock;
  write_register(kCounter, 0xFFFF'FFFFU - 25U * 1000U);  // 1 ms before it wraps.
  clock.start();
  std::uint64_t last = clock.now_us();
  bool wrapped = false;
  while (!wrapped || read_register(kCounter) < 25U * 1000U) {
    const std::uint64_t now = clock.now_us();
    check(now >= last && now - last < 1'000'000, "the clock goes on across the counter's wrap");
    wrapped = wrapped || read_register(kCounter) < 0x8000'0000U;
    last = now;
  }
  check(last >= 1'990, "the clock counts the time before and after the wrap");
}

void check_alarm() noexcept {
  const std::uint64_t begin = board_clock.now_us();
  sleep_until(board_clock, begin + 30'000);
  const std::uint64_t slept = board_clock.now_us() - begin;
  check(slept >= 30'000, "sleep lasts until its time");
  note_activity();
  sleep_until(board_clock, board_clock.now_us() + 60'000'000);  // Would outlast the test.
}

[[nodiscard]] std::array<std::byte, Eeprom::kPageBytes> page(std::uint8_t first) noexcept {
  std::array<std::byte, Eeprom::kPageBytes> bytes{};
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    bytes[i] = static_cast<std::byte>(first + i);
  }
  return bytes;
}

void check_eeprom() noexcept {
  Eeprom eeprom;
  const Flash::Geometry g = eeprom.geometry();
  check(g.unit_bytes == 1024 && g.units == 32 && g.program_bytes == 64, "geometry of the EEPROM");
  std::array<std::byte, 1024> unit{};
  check(eeprom.erase(3) && eeprom.read(3 * 1024, unit), "erase and read");
  check(std::ranges::all_of(unit, [](std::byte b) { return b == std::byte{0xFF}; }),
        "erased cells read 0xFF");
  const auto a = page(1);
  const auto b = page(100);
  check(eeprom.program(3 * 1024 + 64, a) && eeprom.program(3 * 1024 + 960, b), "program two pages");
  check(eeprom.read(3 * 1024, unit), "read a unit");
  check(std::ranges::equal(std::span(unit).subspan(64, 64), a), "the first page reads back");
  check(std::ranges::equal(std::span(unit).subspan(960, 64), b), "the last page reads back");
  check(unit[0] == std::byte{0xFF} && unit[128] == std::byte{0xFF}, "no other cell changed");
  check(!eeprom.program(3 * 1024 + 1, a), "an offset inside a page is refused");
  check(!eeprom.program(0, std::span(a).first(10)), "a part of a page is refused");
  check(!eeprom.program(32 * 1024, a) && !eeprom.erase(32), "what lies behind the part is refused");
  check(!eeprom.read(32 * 1024 - 4, std::span(unit).first(8)), "a read past the end is refused");
  check(eeprom.program(31 * 1024 + 960, a), "the last page of the part");
}

void check_missing_eeprom() noexcept {
  Eeprom eeprom;
  std::array<std::byte, 64> bytes{};
  check(!eeprom.read(0, bytes), "a missing EEPROM cannot be read");
  check(!eeprom.program(0, bytes), "a missing EEPROM cannot be programmed");
  check(!eeprom.erase(0), "a missing EEPROM cannot be erased");
}

void check_slots() noexcept {
  Slots slots(1);
  Flash& other = slots.slot(0);
  Flash& running = slots.slot(1);
  std::array<std::byte, 32> cells{};
  std::array<std::byte, 32> read_back{};
  check(other.erase(2) && other.read(2 * 4096, read_back), "erase a unit");
  check(read_back[0] == std::byte{0xFF} && read_back[31] == std::byte{0xFF}, "erased cells read 0xFF");
  cells.fill(std::byte{0xF0});
  check(other.program(2 * 4096, cells), "program");
  cells.fill(std::byte{0x3C});
  check(other.program(2 * 4096, cells) && other.read(2 * 4096, read_back), "program again");
  check(read_back[7] == std::byte{0x30}, "programming clears bits and sets none");
  check(!other.program(2 * 4096 + 8, cells), "an offset inside a granule is refused");
  check(!running.erase(5), "the slot that runs is not erased");
  check(!running.program(1024, cells), "the code that runs is not programmed");
  check(running.program(512 * 1024 - 4096, cells), "its marks can be written");
  check(slots.address(1) == 0x6088'0000, "address of slot 1");
}

}  // namespace
}  // namespace scatter::firmware::mps2_an500

void run_image() noexcept {
  using namespace scatter::firmware::mps2_an500;
  namespace semihosting = scatter::firmware::semihosting;
  begin_boot();
  start_devices();
  std::array<std::byte, 1> letter{};
  while (host_uart.read(letter) == 0) {
  }
  I2cBus::recover();
  if (letter[0] == std::byte{'n'}) {
    check_missing_eeprom();
    semihosting::exit(0);
  }
  check_alarm();
  check_eeprom();
  check_slots();
  Thermometers thermometers;
  thermometers.start();
  // As the emulated parts begin: 0 deg C.
  check(thermometers.sensor_mK() == 273'150 && thermometers.led_board_mK() == 273'150,
        "both thermometers answer");
  check_clock();
  semihosting::exit(0);
}
