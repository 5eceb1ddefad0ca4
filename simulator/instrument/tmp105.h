// What a TMP105 thermometer on the I2C bus reads: 12 bits of 1/16 K.
//
// QEMU's model of the chip (hw/sensor/tmp105.c) takes millidegrees Celsius and keeps
// trunc(mC * 256 / 1000) & 0xFFF0 in its register; the firmware turns that back. An instrument under QEMU and
// the virtual board do the same arithmetic, so that they report the same temperatures.
#pragma once

#include <cstdint>

namespace scatter::simulator {

inline constexpr std::int32_t kIcePoint_mK = 273'150;

/// Register value at a temperature in millidegrees Celsius, -128'000 to 127'999: 1/256 K rounded towards
/// zero, then the four low bits cleared (rounding down, also below zero).
[[nodiscard]] constexpr std::int32_t tmp105_register(std::int32_t temperature_mC) noexcept {
  return (temperature_mC * 256 / 1000) & ~0xF;
}

/// Temperature that the firmware computes from the register [mK], in whole numbers: (raw / 16) sixteenths of
/// a kelvin, of which thousandths are rounded towards zero.
[[nodiscard]] constexpr std::int32_t tmp105_mK(std::int32_t raw) noexcept {
  return kIcePoint_mK + raw / 16 * 1000 / 16;
}

/// Reading at a true temperature [mK].
[[nodiscard]] constexpr std::int32_t tmp105_reading_mK(std::int32_t temperature_mK) noexcept {
  return tmp105_mK(tmp105_register(temperature_mK - kIcePoint_mK));
}

}  // namespace scatter::simulator
