// Sensor, LEDs, monitor, thermometers and reference stage of the virtual board, over the bench.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "firmware/ports/ports.h"
#include "simulator/bench/bench.h"
#include "simulator/faults/fault_plan.h"
#include "simulator/instrument/virtual_clock.h"

namespace scatter::simulator {

/// What the firmware did that a real board would punish; a correct firmware leaves all at 0.
struct Violations {
  std::uint64_t light_changed_in_exposure = 0;
  std::uint64_t stage_moved_in_exposure = 0;
  std::uint64_t rows_out_of_order = 0;
  std::uint64_t trigger_refused = 0;
};

/// Everything of the board that the bench's light reaches. One object, because the sensor sees what
/// the LEDs and the stage do.
///
/// Drift depends on the scheduled time: exposures, readouts and stage movements so far, so that a slow
/// link or host changes nothing. It goes on through resets, as warm electronics do.
/// Threads: one.
class Camera final : public firmware::Sensor,
                     public firmware::Illuminator,
                     public firmware::Monitor,
                     public firmware::Thermometer,
                     public firmware::ReferenceStage {
 public:
  static constexpr std::uint64_t kStageUs = 300'000;  ///< The stage settles in this time.

  Camera(VirtualClock& clock, Bench& bench, const FaultPlan& plan, std::uint64_t seed);

  [[nodiscard]] bool trigger(const firmware::SensorSettings& settings) noexcept override;
  [[nodiscard]] firmware::SensorState state() noexcept override;
  [[nodiscard]] std::uint64_t ready_at_us() noexcept override;
  [[nodiscard]] bool read_rows(std::uint16_t first, std::uint16_t count,
                               std::span<std::uint16_t> out) noexcept override;
  void release() noexcept override;

  [[nodiscard]] bool light(std::uint8_t illumination) noexcept override;
  [[nodiscard]] std::uint32_t reading_uv() noexcept override;
  [[nodiscard]] std::int32_t sensor_mK() noexcept override;
  [[nodiscard]] std::int32_t led_board_mK() noexcept override;

  [[nodiscard]] bool move_to(protocol::Target target) noexcept override;
  [[nodiscard]] bool moving() noexcept override;
  [[nodiscard]] std::uint64_t settled_at_us() noexcept override;

  /// The device restarts: LEDs off, exposure under way cancelled.
  void reset() noexcept;
  /// Somebody has put a sample under the instrument just now.
  void sample_placed() noexcept { placed_us_ = scheduled_us_; }
  /// Exposures begun since power-on.
  [[nodiscard]] std::uint64_t exposures() const noexcept { return exposures_; }
  [[nodiscard]] std::uint64_t scheduled_us() const noexcept { return scheduled_us_; }
  [[nodiscard]] protocol::Target target() const noexcept { return target_; }
  [[nodiscard]] const Violations& violations() const noexcept { return violations_; }

 private:
  struct Shot {
    Exposure exposure;
    std::uint64_t exposed_at_us = 0;  ///< Since power-on: end of the exposure.
    std::uint64_t ready_at_us = 0;    ///< Since power-on: end of the readout.
    bool developed = false;
    bool readout_fails = false;
    std::uint16_t next_row = 0;
  };
  void develop() noexcept;
  [[nodiscard]] bool exposing() const noexcept;

  VirtualClock& clock_;
  Bench& bench_;
  const FaultPlan& plan_;
  std::uint64_t seed_;
  std::optional<Shot> shot_;
  std::vector<std::uint16_t> pixels_;
  std::uint8_t lit_ = kNone;
  std::uint32_t monitor_uv_ = 0;
  std::uint64_t exposures_ = 0;
  std::uint64_t scheduled_us_ = 0;
  std::uint64_t placed_us_ = 0;
  protocol::Target target_ = protocol::Target::kSample;
  std::uint64_t settled_at_us_ = 0;  ///< Since power-on.
  Violations violations_;
};

}  // namespace scatter::simulator
