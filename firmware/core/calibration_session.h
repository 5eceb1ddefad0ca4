// Calibration from the device's side: one session at a time, what the user must do next, and whether
// what is stored is still good. The frames are the host's; the device keeps manifests.
#pragma once

#include <cstdint>

#include "firmware/core/calibration_store.h"
#include "firmware/core/text.h"
#include "firmware/ports/ports.h"
#include "protocol/messages.h"

namespace scatter::firmware {

/// Moment at which a calibration is judged or made.
struct CalibrationMoment {
  std::uint64_t device_time_us = 0;
  std::uint32_t boot_count = 0;
  std::uint64_t unix_time_s = 0;  ///< 0 = unknown.
  std::int32_t sensor_temperature_mK = 0;
  std::int32_t led_temperature_mK = 0;
};

/// Age of a manifest whose age nobody can tell (other boot, no host clock) [s]; counts as too old.
inline constexpr std::uint32_t kUnknownAge = 0xFFFF'FFFF;

/// Can this kind of calibration be used now? Lifetimes and temperature span from the descriptor; a
/// lifetime of 0 s never ends. `manifest` null: needed.
[[nodiscard]] protocol::CalibrationKindState judge(protocol::Target kind,
                                                   const protocol::CalibrationManifest* manifest,
                                                   const CalibrationMoment& now,
                                                   const protocol::Descriptor& descriptor) noexcept;

/// What the user must do to bring a target under an instrument without a stage.
[[nodiscard]] std::string_view placing_instruction(protocol::Target target) noexcept;

class CalibrationSession {
 public:
  /// Opens a session; an older one is closed by it. Numbers rise from 1.
  std::uint32_t begin() noexcept {
    open_ = true;
    return ++number_;
  }
  void end() noexcept { open_ = false; }
  [[nodiscard]] bool is_open(std::uint32_t number) const noexcept { return open_ && number == number_; }

 private:
  std::uint32_t number_ = 0;
  bool open_ = false;
};

/// Every kind's state; the translucent standard only with the transmission module.
[[nodiscard]] protocol::CalibrationState judge_all(const CalibrationStore& store,
                                                   const CalibrationMoment& now,
                                                   const protocol::Descriptor& descriptor) noexcept;

/// The device's own knowledge of a commit: time, boot and temperatures replace what the host sent; the
/// host's clock is kept when it gave one.
[[nodiscard]] protocol::CalibrationManifest stamped(protocol::CalibrationManifest manifest,
                                                    const CalibrationMoment& now) noexcept;

}  // namespace scatter::firmware
