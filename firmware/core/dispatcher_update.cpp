// Firmware updates and the record of the last crash.
#include "firmware/core/dispatcher.h"

namespace scatter::firmware {

using protocol::MessageId;
using protocol::StatusCode;

void Dispatcher::update(const Frame& frame) noexcept {
  const Header& request = frame.header();
  if (!update_) {
    reply_status(request, StatusCode::kUnimplemented, "this device has no slots for firmware images");
    return;
  }
  const bool writes = frame.id() == MessageId::kUpdateBegin || frame.id() == MessageId::kUpdateWrite ||
                      frame.id() == MessageId::kUpdateFinish;
  if (writes && (acquisition_.active() || waiting_ == Waiting::kStart)) {
    reply_status(request, StatusCode::kFailedPrecondition, "a run is on: stop it first");
    return;
  }
  answer_update(request, update_->request(frame, max_payload_));
}

void Dispatcher::answer_update(const Header& request, const UpdateAnswer& answer) noexcept {
  if (answer.status == StatusCode::kPending) {
    update_request_ = request;
    promise_update();
  } else if (answer.with_state) {
    reply(request, update_->state());
  } else {
    reply_status(request, answer.status, answer.text.str());
  }
}

void Dispatcher::promise_update() noexcept {
  update_promised_us_ = ports_.clock.now_us();
  protocol::StatusReply message;
  message.status = StatusCode::kPending;
  message.request = update_request_->message;
  message.pending_ms = UpdateReceiver::kPendingMs;
  reply(*update_request_, message);
}

bool Dispatcher::go_on_with_update() noexcept {
  if (!update_request_) {
    return false;
  }
  if (const auto answer = update_->poll()) {
    const Header request = *update_request_;
    update_request_.reset();
    answer_update(request, *answer);
  } else if (ports_.clock.now_us() >= update_promised_us_ + UpdateReceiver::kPromiseAgainUs) {
    promise_update();
  }
  return true;
}

void Dispatcher::drop_update() noexcept {
  if (update_) {
    update_->cancel();
  }
  update_request_.reset();
}

void Dispatcher::abort_update() noexcept {
  if (update_request_) {
    const Header request = *update_request_;
    drop_update();
    reply_status(request, StatusCode::kAborted, "the device restarts: begin the update again");
  }
}

void Dispatcher::tell_crash() noexcept {
  const protocol::ResetReason reason = ports_.reset.reason();
  if (told_crash_ ||
      (reason != protocol::ResetReason::kFault && reason != protocol::ResetReason::kWatchdog)) {
    return;
  }
  const protocol::FaultRecord record = ports_.reset.fault_record();
  if (record.present == 0) {
    return;
  }
  told_crash_ = true;
  Text text(record.reason == static_cast<std::uint8_t>(protocol::ResetReason::kWatchdog)
                ? "the firmware hung until the watchdog bit, "
                : "the firmware crashed, ");
  text << "exception " << record.exception << " at pc ";
  text.hexadecimal(record.pc) << ", fault status ";
  text.hexadecimal(record.fault_status) << ", boot " << record.boot_count;
  events_.fault(protocol::FaultCode::kFirmwareCrashed, text);
}

}  // namespace scatter::firmware
