#include "firmware/core/usb/rescue_endpoints.h"

#include <algorithm>

#include "protocol/codec.h"
#include "protocol/usb_identity.h"

namespace scatter::firmware {
namespace {

using protocol::Report;
using protocol::RescueAnswer;
using protocol::RescueCommand;
using protocol::StatusCode;

// HID 1.11, section 7.2.
enum HidRequest : std::uint8_t { kGetReport = 1, kGetIdle = 2, kSetReport = 9, kSetIdle = 10 };
// High byte of wValue; the low byte is the report id, and there are none.
constexpr std::uint16_t kInputReport = 0x0100;
constexpr std::uint16_t kOutputReport = 0x0200;
constexpr std::uint16_t kFeatureReport = 0x0300;
constexpr std::uint8_t kFromInterface = 0xA1;
constexpr std::uint8_t kToInterface = 0x21;
constexpr std::uint64_t kIdleUnitUs = 4000;

}  // namespace

void RescueEndpoints::open() noexcept {
  first_ = count_ = 0;
  const protocol::RescueStatus now = service_.status();
  told_run_state_ = now.run_state;
  told_session_ = now.session_open;
  told_presses_ = now.button_presses;
  told_at_us_ = clock_.now_us();
  status_due_ = false;
  idle_ = 0;
}

ControlAnswer RescueEndpoints::request(const ControlRequest& request) noexcept {
  switch (request.request) {
    case kGetReport:
      if (request.type != kFromInterface ||
          (request.value != kInputReport && request.value != kFeatureReport)) {
        return ControlAnswer::stall();
      }
      encode(service_.status(), reply_);
      return ControlAnswer::send(reply_);
    case kSetReport:
      return request.type == kToInterface && request.value == kOutputReport && request.length > 0 &&
                     request.length <= protocol::kReportBytes
                 ? ControlAnswer::receive()
                 : ControlAnswer::stall();
    case kGetIdle:
      if (request.type != kFromInterface || request.value != 0) {
        return ControlAnswer::stall();
      }
      reply_[0] = static_cast<std::byte>(idle_);
      return ControlAnswer::send(std::span(reply_).first(1));
    case kSetIdle:
      if (request.type != kToInterface || (request.value & 0xFFU) != 0 || request.length != 0) {
        return ControlAnswer::stall();
      }
      idle_ = static_cast<std::uint8_t>(request.value >> 8U);
      told_at_us_ = clock_.now_us();
      return ControlAnswer::accept();
    default:
      return ControlAnswer::stall();  // GET_PROTOCOL and SET_PROTOCOL are for boot devices only.
  }
}

ControlAnswer RescueEndpoints::take(std::span<const std::byte> data) noexcept {
  execute(data);
  return ControlAnswer::accept();
}

void RescueEndpoints::execute(std::span<const std::byte> report) noexcept {
  const auto request = protocol::decode_rescue_request(report);
  if (!request) {
    return;
  }
  RescueAnswer answer;
  answer.command = request->command;
  answer.tag = request->tag;
  answer.offset = request->offset;
  switch (request->command) {
    case RescueCommand::kStatus:
      status_due_ = true;
      break;
    case RescueCommand::kAbort:
      answer.status = service_.abort();
      break;
    case RescueCommand::kReboot:
      reboot_at_us_ = reboot_ ? reboot_at_us_ : clock_.now_us() + kRebootGraceUs;
      reboot_ = true;
      break;
    case RescueCommand::kFaultRecord:
      answer.status = fault_record(request->offset, answer);
      break;
  }
  queue(answer);
}

StatusCode RescueEndpoints::fault_record(std::uint16_t offset, RescueAnswer& answer) noexcept {
  const protocol::FaultRecord record = service_.fault_record();
  if (record.present == 0) {
    return StatusCode::kOk;  // total == 0 tells it.
  }
  std::array<std::byte, protocol::max_encoded_size<protocol::FaultRecord>()> bytes{};
  const std::size_t total = protocol::encode(record, bytes).value_or(0);
  answer.total = static_cast<std::uint16_t>(total);
  if (offset > total) {
    return StatusCode::kOutOfRange;
  }
  const std::size_t size = std::min<std::size_t>(total - offset, RescueAnswer::kMostBytes);
  answer.size = static_cast<std::uint8_t>(size);
  std::copy_n(bytes.begin() + offset, size, answer.bytes.begin());
  return StatusCode::kOk;
}

void RescueEndpoints::queue(const RescueAnswer& answer) noexcept {
  if (count_ == kAnswers) {
    first_ = (first_ + 1) % kAnswers;
    --count_;
  }
  encode(answer, answers_[(first_ + count_) % kAnswers]);
  ++count_;
}

/// Compares what the host was told with what is.
void RescueEndpoints::look() noexcept {
  const protocol::RescueStatus now = service_.status();
  const bool changed = now.run_state != told_run_state_ || now.session_open != told_session_ ||
                       now.button_presses != told_presses_;
  const bool repeat = idle_ != 0 && clock_.now_us() >= told_at_us_ + idle_ * kIdleUnitUs;
  status_due_ = status_due_ || changed || repeat;
}

/// The answers first: who asked waits for them. A status is encoded when it leaves, so it is never old.
bool RescueEndpoints::send_next() noexcept {
  if ((count_ == 0 && !status_due_) || controller_.waiting(protocol::usb::kRescueIn) != 0 ||
      controller_.halted(protocol::usb::kRescueIn)) {
    return false;
  }
  if (count_ > 0) {
    (void)controller_.write(protocol::usb::kRescueIn, answers_[first_]);
    first_ = (first_ + 1) % kAnswers;
    --count_;
    return true;
  }
  const protocol::RescueStatus now = service_.status();
  Report report{};
  encode(now, report);
  (void)controller_.write(protocol::usb::kRescueIn, report);
  told_run_state_ = now.run_state;
  told_session_ = now.session_open;
  told_presses_ = now.button_presses;
  told_at_us_ = clock_.now_us();
  status_due_ = false;
  return true;
}

Step RescueEndpoints::poll() noexcept {
  Step step;
  Report report{};
  if (const std::size_t size = controller_.read(protocol::usb::kRescueOut, report); size > 0) {
    execute(std::span(report).first(std::min(size, report.size())));
    step.did_work = true;
  }
  look();
  step.did_work = send_next() || step.did_work;
  if (idle_ != 0 && !status_due_) {
    step.wake_at_us = told_at_us_ + idle_ * kIdleUnitUs;
  }
  return step;
}

Step RescueEndpoints::reboot_when_due() noexcept {
  if (!reboot_) {
    return {};
  }
  const bool told = count_ == 0 && controller_.waiting(protocol::usb::kRescueIn) == 0;
  if (!told && clock_.now_us() < reboot_at_us_) {
    return {.did_work = false, .wake_at_us = reboot_at_us_};
  }
  reboot_ = false;
  service_.reboot();
  return {.did_work = true, .wake_at_us = 0};
}

}  // namespace scatter::firmware
