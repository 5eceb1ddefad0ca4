// Two TMP105 on the I2C bus: 0x48 at the sensor, 0x49 on the LED board, both at 12 bit (1/16 K steps).
#pragma once

#include <cstdint>

#include "firmware/ports/ports.h"

namespace scatter::firmware::mps2_an500 {

/// What a TMP105's temperature register says [mK], rounded down to whole millikelvin; 12 bits, two's
/// complement, left-aligned in 16.
[[nodiscard]] constexpr std::int32_t tmp105_mK(std::uint16_t temperature_register) noexcept {
  const std::int32_t sixteenths = static_cast<std::int16_t>(temperature_register) >> 4;
  return 273'150 + sixteenths * 1000 / 16;
}

/// A thermometer that does not answer reads 0 mK, far outside the specified range: the core then flags
/// every frame and tells the host.
class Thermometers final : public Thermometer {
 public:
  constexpr Thermometers() noexcept = default;
  /// Selects 12 bit. One that is missing stays so until the next start.
  void start() noexcept;
  [[nodiscard]] std::int32_t sensor_mK() noexcept override;
  [[nodiscard]] std::int32_t led_board_mK() noexcept override;
};

}  // namespace scatter::firmware::mps2_an500
