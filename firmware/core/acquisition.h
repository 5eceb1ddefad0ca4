// The run: exposures in the recipe's order, each one read in row bands straight into wire frames.
//
// At most one band (of kMaxRowPixels) and one wire frame are in memory; a whole frame never is. Every step
// does a bounded piece of work (at most one wire frame), so control traffic is served between any two.
#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include "firmware/core/event_log.h"
#include "firmware/core/exposure_planner.h"
#include "firmware/core/frame_tally.h"
#include "firmware/core/link_output.h"
#include "firmware/core/row_packer.h"
#include "firmware/core/scan_plan.h"
#include "firmware/core/shot_sequence.h"
#include "firmware/core/step.h"
#include "firmware/ports/ports.h"
#include "protocol/crc.h"
#include "protocol/session.h"

namespace scatter::firmware {

/// Monitor reading of a healthy LED [uV].
inline constexpr std::uint32_t kMonitorNominal = 500'000;
/// Temperatures in which the instrument is specified [mK]: 5..50 deg C.
inline constexpr std::int32_t kMinTemperature_mK = 278'150;
inline constexpr std::int32_t kMaxTemperature_mK = 323'150;
/// Exposures that may fail in a row before the run ends with kSensorFault.
inline constexpr std::uint32_t kMaxSensorFaults = 3;

/// What names a run and its frames.
struct RunSettings {
  std::uint32_t epoch = 0;
  std::uint32_t may_send_until = 0;       ///< First credit.
  std::uint32_t max_payload = 0;          ///< Negotiated [B].
  protocol::CalibrationId white{};        ///< Current calibrations: of the reflection heads...
  protocol::CalibrationId translucent{};  ///< ...and of the transmission module.
};

class Acquisition {
 public:
  /// `band` holds at least kMaxRowPixels and outlives this.
  Acquisition(Ports& ports, LinkOutput& output, EventLog& events, std::span<std::uint16_t> band) noexcept
      : ports_(ports), output_(output), events_(events), band_(band) {}

  /// Begins a run of `plan` (copied) and returns its id. Only while not active().
  std::uint32_t start(const ScanPlan& plan, const RunSettings& settings) noexcept;
  /// A credit from the host; ignored unless for the run under way and above the last one.
  void credit(std::uint32_t run_id, std::uint32_t may_send_until) noexcept;
  /// Ends the run after the frame in hand.
  void stop() noexcept;
  /// Ends the run now, in any state: LED off, sensor released, the frame in hand is lost_firmware.
  void end_now(protocol::RunEnd reason) noexcept;
  /// end_now() with kAborted by somebody else than the host of the run: take_finished() tells of it.
  void abort_from_outside() noexcept;

  /// One bounded piece of work.
  [[nodiscard]] Step step() noexcept;

  /// From start() until the last frame was handed to the carrier and the end is reported.
  [[nodiscard]] bool active() const noexcept { return phase_ != Phase::kIdle; }
  [[nodiscard]] protocol::RunState state() const noexcept;
  [[nodiscard]] std::uint32_t run_id() const noexcept { return report_.run_id; }
  /// Of the run under way or the last one; run_id 0 = none yet.
  [[nodiscard]] const protocol::RunReport& report() const noexcept { return report_; }
  /// True once after a run that start() began has ended by itself, by stop() or by abort_from_outside().
  [[nodiscard]] bool take_finished() noexcept;

 private:
  enum class Phase : std::uint8_t { kIdle, kNext, kHold, kExposing, kReading, kDraining };

  [[nodiscard]] Step step_next() noexcept;
  [[nodiscard]] Step step_exposing() noexcept;
  [[nodiscard]] Step step_reading() noexcept;
  void trigger() noexcept;
  void exposed() noexcept;
  void check_environment() noexcept;
  void send_begin(std::span<std::byte> slot) noexcept;
  [[nodiscard]] bool send_band(std::span<std::byte> slot) noexcept;
  void send_end(std::span<std::byte> slot) noexcept;
  [[nodiscard]] bool read_band(std::uint16_t first, std::uint16_t rows) noexcept;
  void lose_frame(protocol::FaultCode code, std::string_view what) noexcept;
  void drop_frame() noexcept;
  void finish(protocol::RunEnd reason) noexcept;
  void lights_out() noexcept;
  [[nodiscard]] bool test_pattern() const noexcept { return plan_->recipe().test_pattern != 0; }
  [[nodiscard]] bool live() const noexcept { return plan_->recipe().live_preview != 0; }

  Ports& ports_;
  LinkOutput& output_;
  EventLog& events_;
  std::optional<ScanPlan> plan_;
  RunSettings settings_;
  ShotSequence sequence_;
  FrameTally tally_;
  RowPacker packer_;
  protocol::CreditWindow credit_;
  Phase phase_ = Phase::kIdle;
  bool finished_ = false;
  bool stopping_ = false;
  bool lit_ = false;
  bool begun_ = false;         // FrameBegin submitted.
  bool end_in_slot_ = false;   // The frame last submitted was a FrameEnd.
  bool told_monitor_ = false;  // Each fault is told once per run.
  bool told_temperature_ = false;
  std::uint32_t next_run_id_ = 1;
  std::uint32_t next_frame_id_ = 0;
  std::uint32_t sensor_faults_ = 0;
  std::uint64_t hold_since_us_ = 0;
  std::uint64_t triggered_us_ = 0;
  std::uint32_t took_us_ = 0;
  std::uint16_t flags_ = 0;
  std::uint32_t sent_bytes_ = 0;
  std::uint32_t frame_crc_ = 0;
  protocol::TailCrc tail_crc_;
  std::uint16_t rows_read_ = 0;
  std::size_t band_first_ = 0;  // Pixels of the band not yet packed: [band_first_, band_end_).
  std::size_t band_end_ = 0;
  Shot shot_;
  protocol::FrameBegin begin_;
  protocol::RunReport report_;
  std::span<std::uint16_t> band_;
};

}  // namespace scatter::firmware
