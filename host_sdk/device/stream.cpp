#include "host_sdk/device/stream.h"

#include <algorithm>
#include <utility>

#include "host_sdk/device/ledger.h"
#include "host_sdk/device/stream_state.h"

namespace scatter::device {

namespace {

// Waits are cut into slices so that request_stop() from another thread is noticed.
constexpr Duration kSlice = std::chrono::milliseconds(20);
// Silence after which the host asks what is going on: a credit or the end may have been lost.
constexpr Duration kSilence = std::chrono::milliseconds(500);
constexpr int kRepeatedGrants = 3;
constexpr Duration kLiveSilence = std::chrono::milliseconds(100);
constexpr std::uint32_t kMaxCatchUp = 1U << 20U;
constexpr Duration kInquiry = std::chrono::seconds(1);
// After the end of a run: control overtakes stream data, so the last chunks may still be on the way.
constexpr Duration kTail = std::chrono::milliseconds(250);
constexpr Duration kFarewell = std::chrono::seconds(1);

protocol::RunReport as_report(const protocol::RunFinished& event) {
  return {.run_id = event.run_id,
          .reason = event.reason,
          .ledger = event.ledger,
          .frames_sent = event.frames_sent,
          .started_us = event.started_us,
          .ended_us = event.ended_us,
          .held_us = event.held_us};
}

}  // namespace

Stream::State::State(std::shared_ptr<Session> session, const AssemblerLimits& limits, const StreamPlan& plan)
    : session_(std::move(session)),
      assembler_(std::make_shared<PixelPool>(), limits),
      plan_(plan),
      granted_until_(plan.window),
      before_(session_->statistics()) {
  session_->set_sink(this);
}

Stream::State::~State() {
  if (running_ && !finished_ && !session_->closed()) {
    (void)abort({.timeout = kFarewell, .stop = {}});
  }
  finish();
}

void Stream::State::finish() {
  if (finished_) {
    return;
  }
  finished_ = true;
  assembler_.flush();
  after_ = session_->statistics();
  if (session_->sink() == this) {
    session_->set_sink(nullptr);
  }
  if (assembler_.run()) {
    session_->last_run = assembler_.run();
  }
}

Status Stream::State::start(std::uint32_t epoch, const Wait& wait) {
  const Result<protocol::Started> reply = session_->request<protocol::Started>(
      protocol::Start{.epoch = epoch, .may_send_until = granted_until_}, wait);
  if (!reply) {
    if (reply.error().code == ErrorCode::kDeadlineExceeded || reply.error().code == ErrorCode::kAborted) {
      running_ = true;  // It may have started all the same: the destructor ends it.
    }
    return std::unexpected(reply.error());
  }
  running_ = true;
  started = *reply;
  if (assembler_.run() && *assembler_.run() != started.run_id) {
    return fail(ErrorCode::kDataLoss,
                "start: the device names run " + std::to_string(started.run_id) +
                    " and sends frames of run " + std::to_string(*assembler_.run()),
                "restart the device, then try again");
  }
  assembler_.set_run(started.run_id);
  last_activity_ = session_->now();
  return recorder_error_ ? Status(std::unexpected(*recorder_error_)) : Status();
}

void Stream::State::record(const protocol::Frame& frame, std::uint64_t host_time_unix_ns) {
  if (plan_.recorder == nullptr || recorder_error_) {
    return;
  }
  if (Status written = plan_.recorder->wire(frame.bytes(), host_time_unix_ns); !written) {
    recorder_error_ = std::move(written.error());
  }
}

void Stream::State::on_stream(const protocol::Frame& frame, std::uint64_t host_time_unix_ns) {
  last_activity_ = session_->arrived();
  record(frame, host_time_unix_ns);
  assembler_.accept(frame, host_time_unix_ns);
  catch_up_ = 0;
  holds_ = 0;
  while (plan_.live && assembler_.ready() > plan_.window) {
    lost_host_ += assembler_.pop()->status == FrameStatus::kComplete ? 1U : 0U;
  }
}

void Stream::State::on_message(const protocol::Frame& frame, std::uint64_t host_time_unix_ns) {
  record(frame, host_time_unix_ns);
  if (const auto event = frame.as<protocol::RunFinished>()) {
    take_report(as_report(*event));
  } else if (const auto reply = frame.as<protocol::RunReport>()) {
    take_report(*reply);
  }
}

void Stream::State::take_report(const protocol::RunReport& report) {
  const std::optional<std::uint32_t> run = assembler_.run();
  const bool mine =
      run ? report.run_id == *run
          : running_ || !session_->last_run || protocol::comes_before(*session_->last_run, report.run_id);
  if (mine && !report_) {
    report_ = report;
    assembler_.set_run(report.run_id);
    last_activity_ = session_->now();
  }
}

Status Stream::State::grant(std::uint32_t until, const std::stop_token& stop) {
  granted_until_ = until;
  assembler_.set_until(until);
  const protocol::Credit credit{.run_id = started.run_id, .may_send_until = until};
  return session_->notify(credit, session_->now() + kInquiry, stop);
}

Frame Stream::State::hand_out(Frame frame) {
  switch (frame.status) {
    case FrameStatus::kComplete:
      ++delivered_;
      break;
    case FrameStatus::kCorrupt:
      ++corrupt_;
      break;
    case FrameStatus::kIncomplete:
      break;
  }
  return frame;
}

Result<std::optional<Frame>> Stream::State::next(const Wait& wait) {
  const TimePoint deadline = session_->now() + wait.timeout;
  for (;;) {
    if (recorder_error_) {
      return std::unexpected(*recorder_error_);
    }
    if (std::optional<Frame> frame = assembler_.pop()) {
      const std::uint32_t until = frame->begin.frame_id + 1 + plan_.window;
      if (!report_ && !broken_ && !finished_ && protocol::comes_before(granted_until_, until)) {
        // A grant that cannot be sent shows as a broken session when nothing more comes.
        (void)grant(until, wait.stop);
      }
      return hand_out(std::move(*frame));
    }
    if (broken_) {
      return std::unexpected(*broken_);
    }
    if (finished_) {
      return std::nullopt;
    }
    const TimePoint now = session_->now();
    if (report_ && ((assembler_.counters().ends_seen >= report_->frames_sent && assembler_.open() == 0) ||
                    now - last_activity_ >= kTail)) {
      finish();
      continue;
    }
    if (wait.stop.stop_requested()) {
      return fail(ErrorCode::kAborted, "stream: stopped", "start again when ready");
    }
    if (stop_requested.load(std::memory_order_relaxed) && !stop_sent_ && !report_) {
      const Status stopped = stop(deadline, wait.stop);
      if (!stopped && stopped.error().code != ErrorCode::kDisconnected) {
        return std::unexpected(stopped.error());
      }
      continue;
    }
    if (now >= deadline) {
      return fail(ErrorCode::kDeadlineExceeded, "stream: no frame came in time",
                  "wait longer; if it stays silent, check that the device has power and the cable is good");
    }
    if (plan_.live && !report_ && now - last_activity_ >= kLiveSilence && catch_up_ < kMaxCatchUp) {
      (void)catch_up(wait.stop);
      continue;
    }
    if (!report_ && now - last_activity_ >= kSilence) {
      const Status asked = inquire(std::min(deadline, now + kInquiry), wait.stop);
      if (!asked && asked.error().code == ErrorCode::kAborted) {
        return std::unexpected(asked.error());
      }
      continue;
    }
    // While bytes keep coming nothing above is due before the slice ends, a frame is there or the run is
    // over.
    const TimePoint slice = std::min(deadline, now + kSlice);
    Status pumped;
    do {
      pumped = session_->pump(slice, wait.stop);
    } while (pumped && assembler_.ready() == 0 && !report_ && !recorder_error_ &&
             session_->arrived() < slice);
    if (!pumped && pumped.error().code == ErrorCode::kDisconnected) {
      broken_ = pumped.error();
      finish();
    } else if (!pumped && pumped.error().code == ErrorCode::kAborted) {
      return std::unexpected(pumped.error());
    }
  }
}

Status Stream::State::inquire(TimePoint deadline, const std::stop_token& stop) {
  const auto status = session_->request<protocol::DeviceStatus>(protocol::GetStatus{}, deadline, stop);
  last_activity_ = session_->now();
  if (!status) {
    if (status.error().code == ErrorCode::kDisconnected) {
      broken_ = status.error();
      finish();
    } else if (status.error().code == ErrorCode::kFailedPrecondition) {
      broken_ = explain_restart(stop);
      finish();
    }
    return std::unexpected(status.error());
  }
  if (report_ || assembler_.ready() != 0) {
    return {};
  }
  const auto state = static_cast<protocol::RunState>(status->run_state);
  if (state == protocol::RunState::kIdle || status->run_id != started.run_id) {
    // The run ended and its RunFinished was lost. Stop repeats the report of the last run.
    const auto report = session_->request<protocol::RunReport>(protocol::Stop{}, deadline, stop);
    if (!report_ && (report || report.error().code == ErrorCode::kFailedPrecondition)) {
      finish();
    }
    return {};
  }
  if (state == protocol::RunState::kHolding) {
    // It has sent all it may as far as it knows: open frames will not be completed.
    assembler_.flush();
    if (assembler_.ready() != 0) {
      return {};
    }
    // Either the last grant was lost, or all the frames it allowed were. Repeating it is harmless.
    if (++holds_ > kRepeatedGrants) {
      holds_ = 0;
      assembler_.skip_to(granted_until_);
      return grant(granted_until_ + plan_.window, stop);
    }
  }
  return grant(granted_until_, stop);
}

Status Stream::State::catch_up(const std::stop_token& stop) {
  catch_up_ = catch_up_ == 0 ? plan_.window : 2 * catch_up_;
  last_activity_ = session_->now();
  return grant(granted_until_ + catch_up_, stop);
}

Error Stream::State::explain_restart(const std::stop_token& stop) {
  const std::uint32_t boots = session_->hello().boot_count;
  const Result<protocol::HelloReply> again = session_->renew(session_->now() + kInquiry, stop);
  if (!again || again->boot_count == boots) {
    return {ErrorCode::kDisconnected, "stream: the device lost the session during the run",
            "open the device again; another program may have taken it over"};
  }
  static constexpr std::array kReasons{"power on", "request", "watchdog", "fault", "brown-out"};
  const std::size_t reason = again->reset_reason;
  return {ErrorCode::kDisconnected,
          std::string("stream: the device restarted during the run (reason: ") +
              (reason < kReasons.size() ? kReasons[reason] : "unknown") + ")",
          "open the device again and repeat the measurement"};
}

Status Stream::State::stop(TimePoint deadline, const std::stop_token& stop) {
  if (report_ || finished_) {
    return {};
  }
  const auto report = session_->request<protocol::RunReport>(protocol::Stop{}, deadline, stop);
  if (!report) {
    if (report.error().code == ErrorCode::kDisconnected) {
      broken_ = report.error();
      finish();
    }
    return std::unexpected(report.error());
  }
  stop_sent_ = true;
  return {};
}

Result<RunSummary> Stream::State::abort(const Wait& wait) {
  Status outcome;
  if (!report_ && !finished_) {
    const auto report = session_->request<protocol::RunReport>(protocol::Abort{}, wait);
    if (!report) {
      outcome = std::unexpected(report.error());
    }
  }
  // Frames that were sent whole before the abort count as dropped here, not as lost on the link.
  const TimePoint drained_by = session_->now() + kTail;
  while (outcome && !finished_ && report_ && assembler_.counters().ends_seen < report_->frames_sent &&
         session_->pump(drained_by, wait.stop)) {
  }
  if (outcome || outcome.error().code == ErrorCode::kDisconnected ||
      outcome.error().code == ErrorCode::kFailedPrecondition) {
    finish();
  }
  while (const std::optional<Frame> frame = assembler_.pop()) {
    lost_host_ += frame->status == FrameStatus::kComplete ? 1U : 0U;
    corrupt_ += frame->status == FrameStatus::kCorrupt ? 1U : 0U;
  }
  if (!outcome) {
    return std::unexpected(outcome.error());
  }
  running_ = false;
  return summary();
}

RunSummary Stream::State::summary() const {
  RunSummary out;
  out.run_id = assembler_.run().value_or(started.run_id);
  out.device_reported = report_.has_value();
  protocol::Ledger device_half;
  if (report_) {
    out.reason = static_cast<protocol::RunEnd>(report_->reason);
    out.frames_sent = report_->frames_sent;
    out.started_us = report_->started_us;
    out.ended_us = report_->ended_us;
    out.held_us = report_->held_us;
    device_half = report_->ledger;
  } else {
    out.reason = protocol::RunEnd::kHostGone;
    out.started_us = started.device_time_us;
    device_half.exposed = assembler_.seen_until();
  }
  out.ledger = completed_ledger(device_half, delivered_, lost_host_, corrupt_);
  const LinkStatistics now = finished_ ? after_ : session_->statistics();
  out.link.bytes = now.bytes - before_.bytes;
  out.link.wire_frames = now.wire_frames - before_.wire_frames;
  out.link.bad_frames = now.bad_frames - before_.bad_frames;
  out.link.skipped_bytes = now.skipped_bytes - before_.skipped_bytes;
  out.link.stale_frames = now.stale_frames - before_.stale_frames;
  out.link.duplicate_chunks = assembler_.counters().duplicate_chunks;
  out.link.unrequested_chunks = assembler_.counters().unrequested_chunks;
  out.link.incomplete_frames = assembler_.counters().incomplete;
  out.link.copied_bytes = now.copied_bytes - before_.copied_bytes;
  out.link.pixel_bytes = assembler_.counters().pixel_bytes;
  out.link.carrier_stalls = now.carrier_stalls - before_.carrier_stalls;
  out.link.carrier_overflows = now.carrier_overflows - before_.carrier_overflows;
  out.link.carrier_errors = now.carrier_errors - before_.carrier_errors;
  return out;
}

Stream::Stream(std::unique_ptr<State> state) noexcept : state_(std::move(state)) {}
Stream::Stream(Stream&&) noexcept = default;
Stream& Stream::operator=(Stream&&) noexcept = default;
Stream::~Stream() = default;

Result<std::optional<Frame>> Stream::next(const Wait& wait) {
  return state_->next(wait);
}

void Stream::request_stop() noexcept {
  state_->stop_requested.store(true, std::memory_order_relaxed);
}

Status Stream::stop(const Wait& wait) {
  return state_->stop(state_->session_now() + wait.timeout, wait.stop);
}

Result<RunSummary> Stream::abort(const Wait& wait) {
  return state_->abort(wait);
}

RunSummary Stream::summary() const {
  return state_->summary();
}

const protocol::Started& Stream::started() const noexcept {
  return state_->started;
}

}  // namespace scatter::device
