// Configuration, runs and status.
#include "firmware/core/dispatcher.h"
#include "firmware/core/link_damage.h"

namespace scatter::firmware {

using protocol::StatusCode;

namespace {
// A stop waits for the frame in hand: its exposure, its readout and the way to the host [us].
constexpr std::uint64_t kStopPatienceUs = 5'000'000;
}  // namespace

void Dispatcher::get_configuration(const Header& request) noexcept {
  protocol::Configuration message;
  message.epoch = epoch_.current();
  if (plan_) {
    message.recipe = plan_->recipe();
  }
  reply(request, message);
}

void Dispatcher::set_configuration(const Header& request,
                                   const protocol::SetConfiguration& message) noexcept {
  if (acquisition_.active() || waiting_ == Waiting::kStart) {
    reply_status(request, StatusCode::kFailedPrecondition, "a run is on: stop it first");
    return;
  }
  std::string_view reason;
  const auto plan = ScanPlan::make(message.recipe, descriptor_, reason);
  if (!plan) {
    reply_status(request, StatusCode::kInvalidArgument, reason);
    return;
  }
  plan_ = plan;
  protocol::ConfigurationAccepted accepted;
  accepted.epoch = epoch_.advance();
  accepted.planned_frames = plan->planned_frames();
  accepted.planned_duration_us = plan->planned_duration_us();
  reply(request, accepted);
}

void Dispatcher::start(const Header& request, const protocol::Start& message) noexcept {
  if (!plan_) {
    reply_status(request, StatusCode::kFailedPrecondition, "no configuration: set one first");
    return;
  }
  if (message.epoch != epoch_.current()) {
    reply_status(request, StatusCode::kFailedPrecondition,
                 (Text("the current settings epoch is ") << epoch_.current()).str());
    return;
  }
  if (acquisition_.active()) {
    reply_status(request, StatusCode::kFailedPrecondition, "a run is on: stop it first");
    return;
  }
  if (update_ && update_->busy()) {
    reply_status(request, StatusCode::kFailedPrecondition,
                 "a firmware update is under way: wait for its reply");
    return;
  }
  if (!stage_is_free(request)) {
    return;
  }
  if (stage_.present() && plan_->recipe().test_pattern == 0) {
    switch (stage_.move_to(plan_->recipe().target)) {
      case Stage::Move::kNoSuchTarget:
        reply_status(request, StatusCode::kNotFound, "the stage does not carry the recipe's target");
        return;
      case Stage::Move::kMoving:
        waiting_start_ = message;
        wait_for_stage(request, Waiting::kStart);
        return;
      case Stage::Move::kThere:
        break;
    }
  }
  begin_run(request, message);
}

void Dispatcher::begin_run(const Header& request, const protocol::Start& message) noexcept {
  RunSettings settings;
  settings.epoch = epoch_.current();
  settings.may_send_until = message.may_send_until;
  settings.max_payload = max_payload_;
  settings.white = state_.calibrations().current_id(protocol::Target::kWhiteReference);
  settings.translucent = state_.calibrations().current_id(protocol::Target::kTranslucentReference);
  protocol::Started started;
  started.run_id = acquisition_.start(*plan_, settings);
  started.device_time_us = acquisition_.report().started_us;
  reply(request, started);
}

void Dispatcher::stop(const Header& request) noexcept {
  cancel_start();
  if (!acquisition_.active()) {
    reply(request, acquisition_.report());
    return;
  }
  if (stop_request_) {
    reply_status(request, StatusCode::kUnavailable, "a stop is under way");
    return;
  }
  acquisition_.stop();
  stop_request_ = request;
  reply_pending(request, ports_.clock.now_us() + kStopPatienceUs);
}

void Dispatcher::cancel_start() noexcept {
  if (waiting_ == Waiting::kStart) {
    cancel_waiting();
  }
}

void Dispatcher::answer_stop() noexcept {
  reply(*stop_request_, acquisition_.report());
  stop_request_.reset();
}

void Dispatcher::abort(const Header& request) noexcept {
  cancel_start();
  acquisition_.end_now(protocol::RunEnd::kAborted);
  if (stop_request_) {
    answer_stop();
  }
  reply(request, acquisition_.report());
}

void Dispatcher::abort_from_outside() noexcept {
  acquisition_.abort_from_outside();
  start_aborted_ = waiting_ == Waiting::kStart;
}

void Dispatcher::get_status(const Header& request) noexcept {
  protocol::DeviceStatus status;
  status.run_state = static_cast<std::uint8_t>(acquisition_.state());
  status.device_time_us = ports_.clock.now_us();
  status.sensor_temperature_mK = ports_.thermometer.sensor_mK();
  status.led_temperature_mK = ports_.thermometer.led_board_mK();
  status.epoch = epoch_.current();
  status.run_id = acquisition_.run_id();
  count_damage(counters_, ports_.link, status);
  status.stale_session = stale_frames_;
  status.duplicates = duplicates_;
  status.unknown_events = unknown_events_;
  status.last_fault = static_cast<std::uint16_t>(events_.last_fault());
  status.calibration_records_recovered = state_.report().damaged;
  status.worst_poll_us = worst_poll_us_;
  reply(request, status);
}

}  // namespace scatter::firmware
