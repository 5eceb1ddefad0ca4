// AT24C256 EEPROM (32 KiB, I2C address 0x50) as a Flash port: the calibration store and the settings.
#pragma once

#include <cstdint>
#include <span>

#include "firmware/ports/ports.h"

namespace scatter::firmware::mps2_an500 {

/// Program granule = the part's page of 64 bytes, which one transfer writes. An erase writes 0xFF pages. A
/// missing or failing part makes every operation return false. Calls block: about 0.1 ms a page on an
/// emulated board, up to 5 ms on a real part (its write time).
class Eeprom final : public Flash {
 public:
  static constexpr std::uint32_t kPageBytes = 64;
  static constexpr std::uint32_t kUnitBytes = 1024;
  static constexpr std::uint32_t kUnits = 32;

  constexpr Eeprom() noexcept = default;
  [[nodiscard]] Geometry geometry() noexcept override { return {kUnitBytes, kUnits, kPageBytes}; }
  [[nodiscard]] bool read(std::uint32_t offset, std::span<std::byte> out) noexcept override;
  [[nodiscard]] bool program(std::uint32_t offset, std::span<const std::byte> bytes) noexcept override;
  [[nodiscard]] bool erase(std::uint32_t unit) noexcept override;
};

}  // namespace scatter::firmware::mps2_an500
