// Offsets as in the tables of SPEC.md section 12.
#include "protocol/rescue_report.h"

#include <algorithm>

#include "protocol/endian.h"

namespace scatter::protocol {
namespace {

// First byte of every report; second byte of an input report.
constexpr std::size_t kVersionAt = 0;
constexpr std::size_t kKindAt = 1;
constexpr std::uint8_t kStatusKind = 1;
constexpr std::uint8_t kAnswerKind = 2;
constexpr std::size_t kAnswerBytesAt = 12;

constexpr std::uint8_t kSessionOpen = 1U << 0U;
constexpr std::uint8_t kFaultRecorded = 1U << 1U;
constexpr std::uint8_t kDfuMode = 1U << 2U;

/// 64 bytes, whatever came: what a short report leaves out is zero.
[[nodiscard]] Report whole(std::span<const std::byte> report) noexcept {
  Report bytes{};
  std::copy_n(report.begin(), std::min(report.size(), bytes.size()), bytes.begin());
  return bytes;
}

[[nodiscard]] bool is_command(std::uint8_t value) noexcept {
  return value >= static_cast<std::uint8_t>(RescueCommand::kStatus) &&
         value <= static_cast<std::uint8_t>(RescueCommand::kFaultRecord);
}

[[nodiscard]] bool is_status(std::uint16_t value) noexcept {
  return std::ranges::any_of(kStatusTable, [value](const StatusInfo& info) {
    return static_cast<std::uint16_t>(info.code) == value;
  });
}

template <typename T>
[[nodiscard]] T field(const Report& report, std::size_t at) noexcept {
  return load_le<T>(report.data() + at);
}

}  // namespace

void encode(const RescueRequest& request, Report& out) noexcept {
  out.fill(std::byte{0});
  store_le(out.data() + kVersionAt, kRescueVersion);
  store_le(out.data() + 1, request.command);
  store_le(out.data() + 2, request.tag);
  store_le(out.data() + 4, request.offset);
}

void encode(const RescueAnswer& answer, Report& out) noexcept {
  out.fill(std::byte{0});
  store_le(out.data() + kVersionAt, kRescueVersion);
  store_le(out.data() + kKindAt, kAnswerKind);
  store_le(out.data() + 2, answer.command);
  store_le(out.data() + 3, answer.tag);
  store_le(out.data() + 4, answer.status);
  store_le(out.data() + 6, answer.offset);
  store_le(out.data() + 8, answer.total);
  const std::size_t size = std::min<std::size_t>(answer.size, RescueAnswer::kMostBytes);
  store_le(out.data() + 10, static_cast<std::uint8_t>(size));
  std::copy_n(answer.bytes.begin(), size, out.begin() + kAnswerBytesAt);
}

void encode(const RescueStatus& status, Report& out) noexcept {
  out.fill(std::byte{0});
  store_le(out.data() + kVersionAt, kRescueVersion);
  store_le(out.data() + kKindAt, kStatusKind);
  store_le(out.data() + 2, status.run_state);
  store_le(out.data() + 3, status.reset_reason);
  std::uint8_t flags = status.session_open ? kSessionOpen : std::uint8_t{0};
  flags |= status.fault_recorded ? kFaultRecorded : std::uint8_t{0};
  flags |= status.dfu_mode ? kDfuMode : std::uint8_t{0};
  store_le(out.data() + 4, flags);
  store_le(out.data() + 8, status.button_presses);
  store_le(out.data() + 12, status.boot_count);
  store_le(out.data() + 16, status.run_id);
  store_le(out.data() + 20, status.exposed);
  store_le(out.data() + 24, status.uptime_us);
  store_le(out.data() + 32, status.worst_poll_us);
  store_le(out.data() + 36, status.sensor_mK);
  store_le(out.data() + 40, status.led_board_mK);
}

std::optional<RescueRequest> decode_rescue_request(std::span<const std::byte> report) noexcept {
  const Report bytes = whole(report);
  const auto command = field<std::uint8_t>(bytes, 1);
  if (field<std::uint8_t>(bytes, kVersionAt) != kRescueVersion || !is_command(command)) {
    return std::nullopt;
  }
  return RescueRequest{.command = static_cast<RescueCommand>(command),
                       .tag = field<std::uint8_t>(bytes, 2),
                       .offset = field<std::uint16_t>(bytes, 4)};
}

std::optional<RescueAnswer> decode_rescue_answer(std::span<const std::byte> report) noexcept {
  const Report bytes = whole(report);
  const auto command = field<std::uint8_t>(bytes, 2);
  const auto status = field<std::uint16_t>(bytes, 4);
  RescueAnswer answer;
  answer.tag = field<std::uint8_t>(bytes, 3);
  answer.offset = field<std::uint16_t>(bytes, 6);
  answer.total = field<std::uint16_t>(bytes, 8);
  answer.size = field<std::uint8_t>(bytes, 10);
  if (field<std::uint8_t>(bytes, kVersionAt) != kRescueVersion ||
      field<std::uint8_t>(bytes, kKindAt) != kAnswerKind || !is_command(command) || !is_status(status) ||
      answer.size > RescueAnswer::kMostBytes ||
      (answer.size > 0 && answer.offset + answer.size > answer.total)) {
    return std::nullopt;
  }
  answer.command = static_cast<RescueCommand>(command);
  answer.status = static_cast<StatusCode>(status);
  std::copy_n(bytes.begin() + kAnswerBytesAt, answer.size, answer.bytes.begin());
  return answer;
}

std::optional<RescueStatus> decode_rescue_status(std::span<const std::byte> report) noexcept {
  const Report bytes = whole(report);
  RescueStatus status;
  status.run_state = field<std::uint8_t>(bytes, 2);
  status.reset_reason = field<std::uint8_t>(bytes, 3);
  if (field<std::uint8_t>(bytes, kVersionAt) != kRescueVersion ||
      field<std::uint8_t>(bytes, kKindAt) != kStatusKind ||
      status.run_state > static_cast<std::uint8_t>(RunState::kHolding) ||
      status.reset_reason > static_cast<std::uint8_t>(ResetReason::kBrownOut)) {
    return std::nullopt;
  }
  const auto flags = field<std::uint8_t>(bytes, 4);
  status.session_open = (flags & kSessionOpen) != 0;
  status.fault_recorded = (flags & kFaultRecorded) != 0;
  status.dfu_mode = (flags & kDfuMode) != 0;
  status.button_presses = field<std::uint32_t>(bytes, 8);
  status.boot_count = field<std::uint32_t>(bytes, 12);
  status.run_id = field<std::uint32_t>(bytes, 16);
  status.exposed = field<std::uint32_t>(bytes, 20);
  status.uptime_us = field<std::uint64_t>(bytes, 24);
  status.worst_poll_us = field<std::uint32_t>(bytes, 32);
  status.sensor_mK = field<std::int32_t>(bytes, 36);
  status.led_board_mK = field<std::int32_t>(bytes, 40);
  return status;
}

}  // namespace scatter::protocol
