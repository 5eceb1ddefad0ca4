#include "firmware/boards/mps2_an500/eeprom.h"

#include <array>

#include "firmware/boards/mps2_an500/i2c_bus.h"

namespace scatter::firmware::mps2_an500 {
namespace {

constexpr std::uint8_t kAddress = 0x50;
constexpr std::uint32_t kBytes = Eeprom::kUnitBytes * Eeprom::kUnits;
// While the part writes a page it does not acknowledge; its data sheet says at most 5 ms. One poll is ten
// clocks of at least 1 us each on any bus that the part takes.
constexpr int kPolls = 2000;

[[nodiscard]] std::array<std::byte, 2> word_address(std::uint32_t offset) noexcept {
  return {static_cast<std::byte>(offset >> 8U), static_cast<std::byte>(offset & 0xFFU)};
}

[[nodiscard]] bool wait_until_written() noexcept {
  for (int i = 0; i < kPolls; ++i) {
    if (I2cBus::write(kAddress, {})) {
      return true;
    }
  }
  return false;
}

[[nodiscard]] bool write_page(std::uint32_t offset, std::span<const std::byte> bytes) noexcept {
  return I2cBus::write(kAddress, word_address(offset), bytes) && wait_until_written();
}

}  // namespace

bool Eeprom::read(std::uint32_t offset, std::span<std::byte> out) noexcept {
  return offset <= kBytes && out.size() <= kBytes - offset &&
         I2cBus::read(kAddress, word_address(offset), out);
}

bool Eeprom::program(std::uint32_t offset, std::span<const std::byte> bytes) noexcept {
  if (offset % kPageBytes != 0 || bytes.size() % kPageBytes != 0 || offset > kBytes ||
      bytes.size() > kBytes - offset) {
    return false;
  }
  for (std::size_t at = 0; at < bytes.size(); at += kPageBytes) {
    if (!write_page(offset + static_cast<std::uint32_t>(at), bytes.subspan(at, kPageBytes))) {
      return false;
    }
  }
  return true;
}

bool Eeprom::erase(std::uint32_t unit) noexcept {
  if (unit >= kUnits) {
    return false;
  }
  std::array<std::byte, kPageBytes> erased{};
  erased.fill(std::byte{0xFF});
  for (std::uint32_t at = 0; at < kUnitBytes; at += kPageBytes) {
    if (!write_page(unit * kUnitBytes + at, erased)) {
      return false;
    }
  }
  return true;
}

}  // namespace scatter::firmware::mps2_an500
