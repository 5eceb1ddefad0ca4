// The virtual board's time: counts from boot, moves on request (virtual) or by itself (real).
#pragma once

#include <algorithm>
#include <chrono>
#include <cstdint>

#include "firmware/ports/ports.h"

namespace scatter::simulator {

enum class ClockMode : std::uint8_t {
  kVirtual,  ///< Jumps to the next thing that happens; stands still while the host is busy.
  kReal,     ///< Runs with the computer's monotonic clock, save while light is being computed.
};

/// 2026-01-01T00:00:00Z: when every simulated instrument is switched on, so that runs repeat exactly.
inline constexpr std::uint64_t kPowerOnUnixUs = 1'767'225'600'000'000;

/// Threads: one.
class VirtualClock final : public firmware::Clock {
 public:
  explicit VirtualClock(ClockMode mode) noexcept : mode_(mode), origin_(std::chrono::steady_clock::now()) {}

  /// Since the last boot [us]: the firmware's clock.
  [[nodiscard]] std::uint64_t now_us() noexcept override { return since_power_on_us() - booted_us_; }
  /// Since power-on [us]; unlike now_us() it does not restart with the device.
  [[nodiscard]] std::uint64_t since_power_on_us() const noexcept {
    return mode_ == ClockMode::kVirtual ? ahead_us_ : ahead_us_ + elapsed_us();
  }
  [[nodiscard]] std::uint64_t booted_us() const noexcept { return booted_us_; }
  [[nodiscard]] ClockMode mode() const noexcept { return mode_; }

  /// Virtual mode: time becomes `since_power_on_us`, never less than now. Real mode: no effect.
  void advance_to(std::uint64_t since_power_on_us) noexcept {
    if (mode_ == ClockMode::kVirtual) {
      ahead_us_ = std::max(ahead_us_, since_power_on_us);
    }
  }
  /// Both modes: the instrument spends `duration_us` unused.
  void skip(std::uint64_t duration_us) noexcept { ahead_us_ += duration_us; }
  /// Does `work` in no time of the instrument's: what the computer has to work out an instrument just has,
  /// such as light.
  template <typename Work>
  void outside_time(Work&& work) {
    const auto began = std::chrono::steady_clock::now();
    work();
    origin_ += std::chrono::steady_clock::now() - began;
  }
  void boot() noexcept { booted_us_ = since_power_on_us(); }

 private:
  [[nodiscard]] std::uint64_t elapsed_us() const noexcept {
    const auto elapsed = std::chrono::steady_clock::now() - origin_;
    return static_cast<std::uint64_t>(std::chrono::duration_cast<std::chrono::microseconds>(elapsed).count());
  }

  ClockMode mode_;
  std::chrono::steady_clock::time_point origin_;
  std::uint64_t ahead_us_ = 0;
  std::uint64_t booted_us_ = 0;
};

}  // namespace scatter::simulator
