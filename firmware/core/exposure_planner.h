// Auto exposure: which exposures an illumination gets, from what earlier frames showed and from the
// time that is left. Pure arithmetic: knows no sensor, no clock and no link, so it is tested alone.
//
// Goal per illumination: the shortest exposure has no saturated pixel (or is the sensor's shortest);
// the longest puts the scene's median near 65 % of full scale; neighbouring exposures are at most a
// factor of 8 apart where the longer one saturates. Every exposure is delivered; none is thrown away.
// The whole run (light frames, LED-off frames, readout, all sweeps) ends within the plan's budget.
//
// The planner counts scheduled time (exposure and readout), not waiting for the host: a slow host
// changes no exposure. RAM: about 2.4 KiB. Not thread-safe. Cost of each call: O(brackets).
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "firmware/core/scan_plan.h"
#include "protocol/bounded.h"
#include "protocol/descriptor.h"

namespace scatter::firmware {

/// What one frame showed of the scene, known hot pixels left out.
struct SceneBrightness {
  std::uint32_t saturated_pixels = 0;
  std::uint16_t max_dn = 0;     ///< Brightest unsaturated pixel.
  std::uint16_t median_dn = 0;  ///< Over the image circle; at or above saturation when half of it is.
};

class ExposurePlanner {
 public:
  /// Starts a run. `plan` must be of mode kAuto; it is copied as far as needed.
  void begin(const ScanPlan& plan, const protocol::Descriptor& descriptor) noexcept;

  /// Sweep 0: the position in the recipe's illumination list that next() now serves.
  void begin_illumination(std::size_t position) noexcept;
  /// Next exposure [us] of this illumination; nothing when it has what it needs or time is used up.
  [[nodiscard]] std::optional<std::uint32_t> next() noexcept;
  /// The frame of the last next() was taken and took `took_us` from trigger to readable.
  void record(const SceneBrightness& scene, std::uint32_t took_us) noexcept;
  /// The frame of the last next() was lost; its time is spent.
  void record_lost(std::uint32_t took_us) noexcept;
  /// A frame that teaches nothing (LED off, or a repeat in a later sweep) took this long.
  void record_other(std::uint32_t took_us) noexcept { spent_us_ += took_us; }
  /// Closes the illumination: fixes what later sweeps repeat.
  void end_illumination() noexcept;

  /// Sweeps 1..: exposures to repeat, longest first; at least one.
  [[nodiscard]] std::span<const std::uint32_t> exposures(std::size_t position) const noexcept {
    return kept_[position].view();
  }
  /// Exposure of LED-off frames at the start of a sweep when the recipe leaves it open [us].
  [[nodiscard]] std::uint32_t off_exposure_us(std::uint16_t sweep) const noexcept;

 private:
  struct Taken {
    std::uint32_t exposure_us = 0;
    bool saturated = false;
    float peak = 0;    // Brightest unsaturated signal, share of full scale.
    float median = 0;  // Share of full scale; 1 when at or above saturation.
  };
  using Exposures = protocol::BoundedArray<std::uint32_t, protocol::kMaxExposures>;

  [[nodiscard]] std::optional<std::uint32_t> wanted() const noexcept;
  [[nodiscard]] std::optional<std::uint32_t> wanted_long() const noexcept;
  [[nodiscard]] std::optional<std::uint32_t> wanted_short() const noexcept;
  [[nodiscard]] std::optional<std::uint32_t> wanted_between() const noexcept;
  [[nodiscard]] bool deep_scene() const noexcept;
  [[nodiscard]] float fair_longest_us(bool with_short) const noexcept;
  [[nodiscard]] float hard_limit_us() const noexcept;
  [[nodiscard]] const Exposures* model() const noexcept;
  [[nodiscard]] std::uint32_t clamped(float exposure_us) const noexcept;
  [[nodiscard]] std::uint64_t cost_us(std::uint32_t exposure_us) const noexcept {
    return std::uint64_t{exposure_us} + readout_us_;
  }

  std::array<Exposures, protocol::kMaxIlluminations> kept_{};
  std::array<std::uint8_t, protocol::kMaxIlluminations> heads_{};
  protocol::BoundedArray<Taken, protocol::kMaxExposures> taken_;
  std::size_t count_ = 0;     // Illuminations.
  std::size_t position_ = 0;  // Being served.
  std::uint32_t attempts_ = 0;
  std::uint32_t proposed_us_ = 0;
  std::uint32_t max_brackets_ = 0;
  std::uint32_t sweeps_ = 1;
  std::uint32_t off_frames_ = 0;
  std::uint32_t fixed_off_us_ = 0;  // 0 = follow the longest.
  std::uint32_t first_off_us_ = 0;
  std::uint32_t probe_us_ = 0;
  std::uint32_t min_us_ = 0;
  std::uint32_t max_us_ = 0;
  std::uint32_t readout_us_ = 0;
  std::uint32_t budget_us_ = 0;
  std::uint32_t longest_us_ = 0;    // Of all kept and taken so far.
  std::uint64_t spent_us_ = 0;      // Scheduled time so far.
  std::uint64_t spent_before_ = 0;  // The same when the illumination began.
  std::uint64_t repeat_us_ = 0;     // One later sweep's light frames, finished illuminations.
  std::uint64_t current_us_ = 0;    // This illumination's frames, once.
  float black_dn_ = 0;
  float full_scale_dn_ = 1;  // Saturation less black.
};

}  // namespace scatter::firmware
