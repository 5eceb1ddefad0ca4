// A recipe that was checked against this instrument. A ScanPlan in hand is proof that every number in
// it can be executed; nothing downstream checks again.
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

#include "protocol/descriptor.h"
#include "protocol/types.h"

namespace scatter::firmware {

/// Widest window row that the band buffer takes [px].
inline constexpr std::uint32_t kMaxRowPixels = 8192;
/// Time left unplanned at the end of an auto-exposure run, for the work between exposures [us].
inline constexpr std::uint32_t kBudgetMarginUs = 20'000;

class ScanPlan {
 public:
  /// Checks `recipe`. On refusal returns nothing and sets `reason` to what to correct.
  [[nodiscard]] static std::optional<ScanPlan> make(const protocol::Recipe& recipe,
                                                    const protocol::Descriptor& descriptor,
                                                    std::string_view& reason) noexcept;

  [[nodiscard]] const protocol::Recipe& recipe() const noexcept { return recipe_; }
  [[nodiscard]] std::uint16_t width() const noexcept { return width_; }
  [[nodiscard]] std::uint16_t height() const noexcept { return height_; }
  [[nodiscard]] std::uint32_t pixels() const noexcept { return std::uint32_t{width_} * height_; }
  /// Bytes of pixel data per frame.
  [[nodiscard]] std::uint32_t frame_bytes() const noexcept { return frame_bytes_; }
  /// Readout of one frame of this window [us].
  [[nodiscard]] std::uint32_t readout_us() const noexcept { return readout_us_; }
  /// A pixel at or above this is saturated [DN].
  [[nodiscard]] std::uint16_t saturation_dn() const noexcept { return saturation_dn_; }
  [[nodiscard]] std::uint16_t black_dn() const noexcept { return black_dn_; }
  [[nodiscard]] std::uint8_t bits() const noexcept { return bits_; }
  [[nodiscard]] std::uint32_t min_exposure_us() const noexcept { return min_exposure_us_; }
  [[nodiscard]] std::uint32_t max_exposure_us() const noexcept { return max_exposure_us_; }
  /// Frames of the run: exact for fixed exposures, at most for auto.
  [[nodiscard]] std::uint32_t planned_frames() const noexcept { return planned_frames_; }
  /// Duration without holds [us]: exact for fixed exposures up to the board's own overhead, the budget
  /// for auto; clamped to 2^32 - 1.
  [[nodiscard]] std::uint32_t planned_duration_us() const noexcept { return planned_duration_us_; }
  /// Exposure of the LED-off frames when the recipe leaves it open and nothing was exposed yet [us].
  [[nodiscard]] std::uint32_t first_off_exposure_us() const noexcept { return first_off_exposure_us_; }
  /// kAuto: exposure of the very first frame [us].
  [[nodiscard]] std::uint32_t probe_exposure_us() const noexcept { return probe_exposure_us_; }

 private:
  ScanPlan() noexcept = default;
  void adopt_sensor(const protocol::SensorInfo& sensor) noexcept;
  void schedule() noexcept;

  protocol::Recipe recipe_;
  std::uint16_t width_ = 0;
  std::uint16_t height_ = 0;
  std::uint32_t frame_bytes_ = 0;
  std::uint32_t readout_us_ = 0;
  std::uint16_t saturation_dn_ = 0;
  std::uint16_t black_dn_ = 0;
  std::uint8_t bits_ = 0;
  std::uint32_t min_exposure_us_ = 0;
  std::uint32_t max_exposure_us_ = 0;
  std::uint32_t planned_frames_ = 0;
  std::uint32_t planned_duration_us_ = 0;
  std::uint32_t first_off_exposure_us_ = 0;
  std::uint32_t probe_exposure_us_ = 0;
};

/// Light level from which a pixel of this sensor counts as saturated [DN]: the ADC's last code, or full
/// well less 2 % (the well fills up softly, and noise spreads it), whichever is lower.
[[nodiscard]] std::uint16_t saturation_level(const protocol::SensorInfo& sensor) noexcept;

}  // namespace scatter::firmware
