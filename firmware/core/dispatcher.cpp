// Routing, sessions and replies. Handlers of runs and of calibration are in dispatcher_run.cpp,
// dispatcher_calibration.cpp and dispatcher_update.cpp.
#include "firmware/core/dispatcher.h"

#include <algorithm>

#include "protocol/schema_description.h"

namespace scatter::firmware {
namespace {

using protocol::MessageId;
using protocol::StatusCode;

// A reboot waits this long for its reply to leave [us].
constexpr std::uint64_t kRebootGraceUs = 200'000;
// Promised on top of the time that the stage itself names [us].
constexpr std::uint64_t kPendingMarginUs = 1'000'000;

}  // namespace

Dispatcher::Dispatcher(Ports& ports, LinkOutput& output, EventLog& events, Acquisition& acquisition,
                       PersistentState& state, const protocol::LinkCounters& counters,
                       std::span<std::byte> replies) noexcept
    : ports_(ports),
      output_(output),
      events_(events),
      acquisition_(acquisition),
      state_(state),
      counters_(counters),
      descriptor_(ports.factory.descriptor()),
      objects_(ports.factory),
      stage_(ports.reference_stage),
      cache_(replies, protocol::ReplyCache::kMaxSlots) {
  if (ports.image_slots != nullptr && ports.verifier != nullptr) {
    update_.emplace(*ports.image_slots, *ports.verifier, descriptor_.product.str());
  }
}

void Dispatcher::on_frame(const Frame& frame) noexcept {
  const Header& header = frame.header();
  if (header.channel == protocol::Channel::kEvent) {
    on_event(frame);
    return;
  }
  if (header.channel != protocol::Channel::kControl || header.message >= 0x8000) {
    ++unknown_events_;
    return;
  }
  const bool known_session = session_open_ && header.session == output_.session();
  if (header.id() == MessageId::kHello && !known_session) {
    decoded(frame, &Dispatcher::hello);
    return;
  }
  if (!session_open_) {
    reply_status(header, StatusCode::kFailedPrecondition, "say HELLO first");
    return;
  }
  if (!known_session) {
    ++stale_frames_;
    return;
  }
  switch (cache_.admit(header)) {
    case protocol::ReplyCache::Admission::kRepeat:
      ++duplicates_;
      (void)output_.queue(cache_.reply(header));
      return;
    case protocol::ReplyCache::Admission::kUnderWay:
      ++duplicates_;
      return;
    case protocol::ReplyCache::Admission::kExecute:
    case protocol::ReplyCache::Admission::kUncached:
      execute(frame);
      return;
  }
}

void Dispatcher::on_refused(const Header& header) noexcept {
  if (header.channel == protocol::Channel::kControl && header.message < 0x8000) {
    reply_status(header, StatusCode::kVersionMismatch, "unknown wire major, flag or channel");
  }
}

void Dispatcher::on_event(const Frame& frame) noexcept {
  if (!session_open_ || frame.header().session != output_.session()) {
    ++stale_frames_;
    return;
  }
  if (const auto credit = frame.as<protocol::Credit>()) {
    acquisition_.credit(credit->run_id, credit->may_send_until);
  } else {
    ++unknown_events_;
  }
}

void Dispatcher::execute(const Frame& frame) noexcept {
  (void)tell_finished();  // Before a start that would make the end of the last run forgotten.
  const Header& h = frame.header();
  switch (frame.id()) {
    case MessageId::kHello:
      return decoded(frame, &Dispatcher::hello);
    case MessageId::kObjectRead:
      return decoded(frame, &Dispatcher::object_read);
    case MessageId::kGetConfiguration:
      return get_configuration(h);
    case MessageId::kSetConfiguration:
      return decoded(frame, &Dispatcher::set_configuration);
    case MessageId::kStart:
      return decoded(frame, &Dispatcher::start);
    case MessageId::kStop:
      return stop(h);
    case MessageId::kAbort:
      return abort(h);
    case MessageId::kGetStatus:
      return get_status(h);
    case MessageId::kCalibrationBegin:
      return calibration_begin(h);
    case MessageId::kCalibrationStep:
      return decoded(frame, &Dispatcher::calibration_step);
    case MessageId::kCalibrationCommit:
      return decoded(frame, &Dispatcher::calibration_commit);
    case MessageId::kCalibrationEnd:
      return decoded(frame, &Dispatcher::calibration_end);
    case MessageId::kCalibrationList:
      return calibration_list(h);
    case MessageId::kCalibrationQuery:
      return calibration_query(h);
    case MessageId::kCalibrationUndo:
      return decoded(frame, &Dispatcher::calibration_undo);
    case MessageId::kCalibrationRestoreFactory:
      return restore_factory(h);
    case MessageId::kKeyValueGet:
      return decoded(frame, &Dispatcher::key_value_get);
    case MessageId::kKeyValueSet:
      return decoded(frame, &Dispatcher::key_value_set);
    case MessageId::kReboot:
      return reboot(h);
    case MessageId::kClockSync:
      return decoded(frame, &Dispatcher::clock_sync);
    case MessageId::kUpdateBegin:
    case MessageId::kUpdateWrite:
    case MessageId::kUpdateFinish:
    case MessageId::kUpdateConfirm:
    case MessageId::kUpdateStatus:
      return update(frame);
    case MessageId::kFaultRecordRead:
      return reply(h, ports_.reset.fault_record());
    default:
      return reply_status(h, StatusCode::kUnimplemented, "unknown request");
  }
}

void Dispatcher::reply_status(const Header& request, StatusCode status, std::string_view text) noexcept {
  protocol::StatusReply message;
  message.status = status;
  message.request = request.message;
  message.text = text;
  reply(request, message);
}

void Dispatcher::reply_pending(const Header& request, std::uint64_t until_us) noexcept {
  const std::uint64_t now = ports_.clock.now_us();
  const std::uint64_t wait_us = (until_us > now ? until_us - now : 0) + kPendingMarginUs;
  protocol::StatusReply message;
  message.status = StatusCode::kPending;
  message.request = request.message;
  message.pending_ms = static_cast<std::uint32_t>(std::min<std::uint64_t>(wait_us / 1000, 0xFFFF'FFFF));
  reply(request, message);
}

std::uint32_t Dispatcher::capabilities() const noexcept {
  std::uint32_t bits = 0;
  if (stage_.present()) {
    bits |= protocol::kCapabilityReferenceStage;
  }
  if (descriptor_.transmission_module != 0) {
    bits |= protocol::kCapabilityTransmission;
  }
  if (update_) {
    bits |= protocol::kCapabilityUpdate;
  }
  return bits;
}

void Dispatcher::hello(const Header& request, const protocol::Hello& message) noexcept {
  protocol::Offer offer;
  offer.capabilities = capabilities();
  offer.max_payload = std::min(offer.max_payload, ports_.link.max_payload());
  protocol::Negotiation result = protocol::negotiate(message, offer, protocol::schema_digest());
  if (result.status != StatusCode::kOk) {
    reply(request, result.refusal);
    return;
  }
  acquisition_.end_now(protocol::RunEnd::kHostGone);
  waiting_ = Waiting::kNothing;
  stop_request_.reset();
  calibration_.end();
  drop_update();
  output_.begin_session(request.session);
  cache_.clear();
  (void)cache_.admit(request);
  session_open_ = true;
  max_payload_ = result.reply.max_payload;

  protocol::HelloReply& answer = result.reply;
  answer.build_id = ports_.build_id;
  answer.product = descriptor_.product;
  answer.serial = descriptor_.serial;
  answer.reset_reason = static_cast<std::uint8_t>(ports_.reset.reason());
  answer.boot_count = state_.boot_count();
  answer.device_time_us = ports_.clock.now_us();
  answer.epoch = epoch_.current();
  answer.run_state = static_cast<std::uint8_t>(acquisition_.state());
  reply(request, answer);

  events_.open(true);
  tell_crash();
  if (const protocol::FaultCode fault = fault_of(state_.report());
      !told_recovery_ && fault != protocol::FaultCode::kNone) {
    told_recovery_ = true;
    events_.fault(fault, text_of(state_.report()));
  }
}

void Dispatcher::link_closed() noexcept {
  acquisition_.end_now(protocol::RunEnd::kHostGone);
  waiting_ = Waiting::kNothing;
  stop_request_.reset();
  calibration_.end();
  drop_update();
  cache_.clear();
  session_open_ = false;
  events_.open(false);
}

Step Dispatcher::poll() noexcept {
  const std::uint64_t now = ports_.clock.now_us();
  if (reboot_at_us_ != 0) {
    if (!(output_.idle() && ports_.link.drained()) && now < reboot_at_us_) {
      return {.did_work = false, .wake_at_us = reboot_at_us_};
    }
    reboot_at_us_ = 0;
    rebooting_ = true;
    ports_.reset.reboot();
    return {.did_work = true, .wake_at_us = 0};
  }
  if (!output_.has_control_room()) {
    return {};
  }
  if (tell_finished()) {
    return {.did_work = true, .wake_at_us = 0};
  }
  if (waiting_ != Waiting::kNothing) {
    if (start_aborted_) {
      cancel_start();
      return {.did_work = true, .wake_at_us = 0};
    }
    if (stage_.moving()) {
      return {.did_work = false, .wake_at_us = stage_.settled_at_us()};
    }
    settled();
    return {.did_work = true, .wake_at_us = 0};
  }
  if (go_on_with_update()) {
    return {.did_work = true, .wake_at_us = 0};
  }
  return {};
}

bool Dispatcher::tell_finished() noexcept {
  if (!acquisition_.take_finished()) {
    return false;
  }
  if (stop_request_) {
    answer_stop();
    return true;
  }
  const protocol::RunReport& r = acquisition_.report();
  (void)events_.event(protocol::RunFinished{.run_id = r.run_id,
                                            .reason = r.reason,
                                            .ledger = r.ledger,
                                            .frames_sent = r.frames_sent,
                                            .started_us = r.started_us,
                                            .ended_us = r.ended_us,
                                            .held_us = r.held_us});
  return true;
}

void Dispatcher::wait_for_stage(const Header& request, Waiting waiting) noexcept {
  waiting_ = waiting;
  start_aborted_ = false;
  waiting_request_ = request;
  reply_pending(request, stage_.settled_at_us());
}

void Dispatcher::cancel_waiting() noexcept {
  if (waiting_ != Waiting::kNothing) {
    waiting_ = Waiting::kNothing;
    reply_status(waiting_request_, StatusCode::kAborted, "aborted while the stage moved");
  }
}

void Dispatcher::settled() noexcept {
  const Waiting what = waiting_;
  waiting_ = Waiting::kNothing;
  switch (what) {
    case Waiting::kStart:
      begin_run(waiting_request_, waiting_start_);
      return;
    case Waiting::kStep:
      reply(waiting_request_, protocol::CalibrationPlaced{.placed = 1, .instruction = {}});
      return;
    case Waiting::kEnd:
      reply_status(waiting_request_, StatusCode::kOk);
      return;
    case Waiting::kNothing:
      return;
  }
}

bool Dispatcher::stage_is_free(const Header& request) noexcept {
  if (waiting_ == Waiting::kNothing) {
    return true;
  }
  reply_status(request, StatusCode::kUnavailable, "the stage is moving");
  return false;
}

void Dispatcher::object_read(const Header& request, const protocol::ObjectRead& message) noexcept {
  protocol::ObjectChunk chunk;
  const auto overhead = static_cast<std::uint32_t>(protocol::min_encoded_size<protocol::ObjectChunk>());
  switch (objects_.read(message, max_payload_ - overhead, chunk)) {
    case StatusCode::kOk:
      reply(request, chunk);
      return;
    case StatusCode::kOutOfRange:
      reply_status(request, StatusCode::kOutOfRange,
                   (Text("offset past the object's end at ") << chunk.total).str());
      return;
    default:
      reply_status(request, StatusCode::kNotFound, "no such object: 1 descriptor, 2 hot pixels, 3 PRNU map");
      return;
  }
}

void Dispatcher::reboot(const Header& request) noexcept {
  restart();
  reply_status(request, StatusCode::kOk);
}

void Dispatcher::reboot_from_outside() noexcept {
  restart();
}

void Dispatcher::restart() noexcept {
  acquisition_.end_now(protocol::RunEnd::kAborted);
  if (stop_request_) {
    answer_stop();
  }
  cancel_waiting();
  abort_update();
  reboot_at_us_ = ports_.clock.now_us() + kRebootGraceUs;
}

void Dispatcher::clock_sync(const Header& request, const protocol::ClockSync& message) noexcept {
  const std::uint64_t now = ports_.clock.now_us();
  unix_offset_us_ = message.host_time_us > now ? message.host_time_us - now : 0;
  reply(request, protocol::ClockSynced{.host_time_us = message.host_time_us, .device_time_us = now});
}

CalibrationMoment Dispatcher::moment() noexcept {
  CalibrationMoment now;
  now.device_time_us = ports_.clock.now_us();
  now.boot_count = state_.boot_count();
  now.unix_time_s = unix_offset_us_ == 0 ? 0 : (unix_offset_us_ + now.device_time_us) / 1'000'000;
  now.sensor_temperature_mK = ports_.thermometer.sensor_mK();
  now.led_temperature_mK = ports_.thermometer.led_board_mK();
  return now;
}

}  // namespace scatter::firmware
