// The order of a run's exposures: sweeps outermost; in each sweep the LED-off frames, then every
// illumination with its exposures (Recipe in protocol/types.h).
#pragma once

#include <cstdint>
#include <optional>

#include "firmware/core/exposure_planner.h"
#include "firmware/core/scan_plan.h"
#include "firmware/ports/ports.h"
#include "protocol/descriptor.h"

namespace scatter::firmware {

/// One exposure to make.
struct Shot {
  protocol::FrameKind kind = protocol::FrameKind::kLight;
  std::uint8_t illumination = Illuminator::kNone;
  std::uint8_t bracket = 0;  ///< Within the illumination and sweep.
  std::uint16_t sweep = 0;
  std::uint32_t exposure_us = 0;
};

class ShotSequence {
 public:
  void begin(const ScanPlan& plan, const protocol::Descriptor& descriptor) noexcept;
  /// The next exposure; nothing after the last. Call again only after record or record_lost.
  [[nodiscard]] std::optional<Shot> next() noexcept;
  /// The exposure of the last next() was taken in `took_us` from trigger to readable.
  void record(const SceneBrightness& scene, std::uint32_t took_us) noexcept;
  /// The exposure of the last next() failed or was dropped after `took_us`.
  void record_lost(std::uint32_t took_us) noexcept;

 private:
  [[nodiscard]] std::optional<std::uint32_t> next_light() noexcept;
  [[nodiscard]] bool planning() const noexcept { return automatic_ && sweep_ == 0; }

  protocol::Recipe recipe_;
  ExposurePlanner planner_;
  std::uint32_t first_off_us_ = 0;
  bool automatic_ = false;
  bool off_ = false;   // The last shot was an LED-off one.
  bool open_ = false;  // The planner serves the illumination at position_.
  std::uint16_t sweep_ = 0;
  std::uint32_t off_done_ = 0;
  std::uint32_t off_exposure_us_ = 0;
  std::size_t position_ = 0;
  std::uint8_t bracket_ = 0;
};

}  // namespace scatter::firmware
