// The board's watchdog (CMSDK APB watchdog). Its first timeout is an interrupt that records where the
// processor was and resets; when even that does not work, the second timeout resets.
#pragma once

#include <cstdint>

#include "firmware/boards/mps2_an500/registers.h"
#include "firmware/ports/ports.h"

namespace scatter::firmware::mps2_an500 {

class BoardWatchdog final : public Watchdog {
 public:
  /// Ten times the main loop's longest rest: an emulated processor that has to wait for its host must not
  /// bite.
  static constexpr std::uint32_t kTimeoutUs = 10'000'000;

  constexpr BoardWatchdog() noexcept = default;
  /// Starts it; nothing but a reset stops it again.
  static void start(std::uint32_t timeout_us = kTimeoutUs) noexcept {
    write_register(kLock, kUnlock);
    write_register(kLoad, timeout_us * kCyclesPerUs);
    write_register(kControl, 3);  // Interrupt at the first timeout, reset at the second.
    write_register(kLock, 0);
  }
  void kick() noexcept override {
    write_register(kLock, kUnlock);
    write_register(kClear, 1);  // Reloads.
    write_register(kLock, 0);
  }

 private:
  static constexpr std::uint32_t kLoad = kWatchdogBase;
  static constexpr std::uint32_t kControl = kWatchdogBase + 8;
  static constexpr std::uint32_t kClear = kWatchdogBase + 12;
  static constexpr std::uint32_t kLock = kWatchdogBase + 0xC00;
  static constexpr std::uint32_t kUnlock = 0x1ACC'E551;
};

}  // namespace scatter::firmware::mps2_an500
