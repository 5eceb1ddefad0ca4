// What can be wrong with the instrument's optics and electronics, on purpose.
#pragma once

#include <cstdint>

namespace scatter::simulator {

/// All at their defaults: a healthy instrument. The descriptor never tells of any of these.
struct BenchFaults {
  static constexpr std::uint8_t kNone = 0xFF;

  std::uint8_t dead_illumination = kNone;  ///< This LED stays dark, its monitor too.
  double led_drift_per_s = 0;  ///< Relative change of all LEDs' output per second; the monitor sees it.
  std::uint32_t extra_hot_pixels = 0;    ///< Appeared after production: not in the factory's list.
  double dirt = 0;                       ///< Most light that specks of dust on the lens take away, 0..1.
  std::uint8_t misaligned_head = kNone;  ///< This head has been knocked ...
  double misalignment_rad = 0;           ///< ... by so much towards larger theta.
  double decentred_px = 0;               ///< The sensor has moved along x.
};

}  // namespace scatter::simulator
