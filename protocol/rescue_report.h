// Reports of the HID interface (SPEC.md section 12): what the instrument can be asked, and says on its own,
// while the bulk pipes are stuck. 64 bytes each way, no report ids, little endian, unused bytes zero.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "protocol/messages.h"

namespace scatter::protocol {

inline constexpr std::size_t kReportBytes = 64;
using Report = std::array<std::byte, kReportBytes>;

/// Of this section. Unknown: the report is ignored.
inline constexpr std::uint8_t kRescueVersion = 1;

enum class RescueCommand : std::uint8_t {
  kStatus = 1,       ///< Send a status report now.
  kAbort = 2,        ///< End the run at once, as the message abort does.
  kReboot = 3,       ///< Restart; the answer goes out first.
  kFaultRecord = 4,  ///< Part of the encoded fault_record message from `offset`.
};

/// Host to instrument: output report.
struct RescueRequest {
  RescueCommand command = RescueCommand::kStatus;
  std::uint8_t tag = 0;  ///< Chosen by the host; the answer repeats it.
  std::uint16_t offset = 0;
};

/// Instrument to host: input report of kind 2, one for each request.
struct RescueAnswer {
  static constexpr std::size_t kMostBytes = 48;
  RescueCommand command = RescueCommand::kStatus;
  std::uint8_t tag = 0;
  StatusCode status = StatusCode::kOk;
  std::uint16_t offset = 0;
  std::uint16_t total = 0;  ///< Bytes of the whole object; 0 when there is none.
  std::uint8_t size = 0;    ///< Of `bytes`.
  std::array<std::byte, kMostBytes> bytes{};
};

/// Instrument to host: input report of kind 1 on each change of run state or button, and feature report at
/// any time.
struct RescueStatus {
  std::uint8_t run_state = 0;     ///< RunState.
  std::uint8_t reset_reason = 0;  ///< ResetReason of this boot.
  bool session_open = false;      ///< A host program has said HELLO.
  bool fault_recorded = false;    ///< A crash snapshot can be read.
  bool dfu_mode = false;
  std::uint32_t button_presses = 0;  ///< Of the measure button since boot.
  std::uint32_t boot_count = 0;
  std::uint32_t run_id = 0;   ///< Of the run under way or the last one.
  std::uint32_t exposed = 0;  ///< Frames of that run so far.
  std::uint32_t worst_poll_us = 0;
  std::uint64_t uptime_us = 0;
  std::int32_t sensor_mK = 0;
  std::int32_t led_board_mK = 0;
};

/// Each writes all 64 bytes.
void encode(const RescueRequest& request, Report& out) noexcept;
void encode(const RescueAnswer& answer, Report& out) noexcept;
void encode(const RescueStatus& status, Report& out) noexcept;

/// Nothing when the report is of another kind or version, or a field is out of range. Longer reports are cut.
[[nodiscard]] std::optional<RescueRequest> decode_rescue_request(std::span<const std::byte> report) noexcept;
[[nodiscard]] std::optional<RescueAnswer> decode_rescue_answer(std::span<const std::byte> report) noexcept;
[[nodiscard]] std::optional<RescueStatus> decode_rescue_status(std::span<const std::byte> report) noexcept;

}  // namespace scatter::protocol
