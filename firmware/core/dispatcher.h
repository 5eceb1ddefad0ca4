// Requests in, replies out: sessions, at-most-once execution, and one handler per message.
//
// Every request gets exactly one reply; PENDING may come before it. A request repeated by the host is
// answered from the cache and not executed again. Not thread-safe; no call blocks.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <string_view>

#include "firmware/core/acquisition.h"
#include "firmware/core/calibration_session.h"
#include "firmware/core/event_log.h"
#include "firmware/core/link_output.h"
#include "firmware/core/object_server.h"
#include "firmware/core/persistent_state.h"
#include "firmware/core/stage.h"
#include "firmware/core/update_receiver.h"
#include "firmware/ports/ports.h"
#include "protocol/link_decoder.h"
#include "protocol/session.h"

namespace scatter::firmware {

class Dispatcher {
 public:
  Dispatcher(Ports& ports, LinkOutput& output, EventLog& events, Acquisition& acquisition,
             PersistentState& state, const protocol::LinkCounters& counters,
             std::span<std::byte> replies) noexcept;

  /// One frame from the host. The caller has made sure of LinkOutput::has_control_room().
  void on_frame(const protocol::Frame& frame) noexcept;
  /// An intact frame that this version cannot take (other wire major, unknown incompatible flag).
  void on_refused(const protocol::FrameHeader& header) noexcept;
  /// The carrier closed: ends the run and the session.
  void link_closed() noexcept;
  /// Work that waits for something else: stage settled, run ended, reboot. Bounded.
  [[nodiscard]] Step poll() noexcept;

  /// The message abort, asked for past the link: the run ends at once. Its host gets run_finished with the
  /// reason aborted, or the reply of its stop, when the link has room; a start that waits for the stage gets
  /// ABORTED.
  void abort_from_outside() noexcept;
  /// The message reboot, asked for past the link.
  void reboot_from_outside() noexcept;

  [[nodiscard]] bool session_open() const noexcept { return session_open_; }
  /// Null without slots or verifier. In DFU mode, when no host is on the link, the DFU device's.
  [[nodiscard]] UpdateReceiver* update_receiver() noexcept { return update_ ? &*update_ : nullptr; }
  /// Longest turn of the main loop so far, for the status [us].
  void took(std::uint32_t poll_us) noexcept { worst_poll_us_ = std::max(worst_poll_us_, poll_us); }
  [[nodiscard]] std::uint32_t worst_poll_us() const noexcept { return worst_poll_us_; }
  /// A reboot was asked for and handed to the board.
  [[nodiscard]] bool rebooting() const noexcept { return rebooting_; }

 private:
  using Header = protocol::FrameHeader;
  using Frame = protocol::Frame;
  /// What a reply waits for.
  enum class Waiting : std::uint8_t { kNothing, kStart, kStep, kEnd };

  void on_event(const Frame& frame) noexcept;
  void execute(const Frame& frame) noexcept;

  template <protocol::Message M>
  void reply(const Header& request, const M& message) noexcept;
  void reply_status(const Header& request, protocol::StatusCode status, std::string_view text = {}) noexcept;
  void reply_pending(const Header& request, std::uint64_t until_us) noexcept;
  /// Decodes and calls (this->*handler)(header, message), or replies INVALID_ARGUMENT.
  template <protocol::Message M>
  void decoded(const Frame& frame, void (Dispatcher::*handler)(const Header&, const M&)) noexcept;

  void hello(const Header& request, const protocol::Hello& message) noexcept;
  void object_read(const Header& request, const protocol::ObjectRead& message) noexcept;
  void get_configuration(const Header& request) noexcept;
  void set_configuration(const Header& request, const protocol::SetConfiguration& message) noexcept;
  void start(const Header& request, const protocol::Start& message) noexcept;
  void stop(const Header& request) noexcept;
  void abort(const Header& request) noexcept;
  void get_status(const Header& request) noexcept;
  void calibration_begin(const Header& request) noexcept;
  void calibration_step(const Header& request, const protocol::CalibrationStep& message) noexcept;
  void calibration_commit(const Header& request, const protocol::CalibrationCommit& message) noexcept;
  void calibration_end(const Header& request, const protocol::CalibrationEnd& message) noexcept;
  void calibration_list(const Header& request) noexcept;
  void calibration_query(const Header& request) noexcept;
  void calibration_undo(const Header& request, const protocol::CalibrationUndo& message) noexcept;
  void restore_factory(const Header& request) noexcept;
  void key_value_get(const Header& request, const protocol::KeyValueGet& message) noexcept;
  void key_value_set(const Header& request, const protocol::KeyValueSet& message) noexcept;
  void reboot(const Header& request) noexcept;
  void clock_sync(const Header& request, const protocol::ClockSync& message) noexcept;

  // dispatcher_update.cpp
  void update(const Frame& frame) noexcept;
  void answer_update(const Header& request, const UpdateAnswer& answer) noexcept;
  void promise_update() noexcept;
  [[nodiscard]] bool go_on_with_update() noexcept;
  void drop_update() noexcept;
  void abort_update() noexcept;
  void tell_crash() noexcept;

  void begin_run(const Header& request, const protocol::Start& message) noexcept;
  void wait_for_stage(const Header& request, Waiting waiting) noexcept;
  void cancel_waiting() noexcept;
  void cancel_start() noexcept;
  void restart() noexcept;
  [[nodiscard]] bool tell_finished() noexcept;
  void answer_stop() noexcept;
  void settled() noexcept;
  [[nodiscard]] bool stage_is_free(const Header& request) noexcept;
  [[nodiscard]] CalibrationMoment moment() noexcept;
  [[nodiscard]] std::uint32_t capabilities() const noexcept;

  Ports& ports_;
  LinkOutput& output_;
  EventLog& events_;
  Acquisition& acquisition_;
  PersistentState& state_;
  const protocol::LinkCounters& counters_;
  const protocol::Descriptor& descriptor_;
  ObjectServer objects_;
  Stage stage_;
  CalibrationSession calibration_;
  protocol::EpochCounter epoch_;
  std::optional<ScanPlan> plan_;
  protocol::ReplyCache cache_;

  bool session_open_ = false;
  bool told_recovery_ = false;
  bool rebooting_ = false;
  std::uint32_t max_payload_ = protocol::kMaxPayload;
  std::uint32_t stale_frames_ = 0;
  std::uint32_t duplicates_ = 0;
  std::uint32_t unknown_events_ = 0;
  std::uint32_t worst_poll_us_ = 0;
  std::uint64_t unix_offset_us_ = 0;  // Host's clock less the device's; 0 = unknown.

  Waiting waiting_ = Waiting::kNothing;
  bool start_aborted_ = false;  // A waiting start gets ABORTED when the link has room.
  Header waiting_request_;
  protocol::Start waiting_start_;
  std::optional<Header> stop_request_;
  std::optional<UpdateReceiver> update_;  // Absent without slots or verifier.
  std::optional<Header> update_request_;  // That has not got its last reply.
  std::uint64_t update_promised_us_ = 0;
  bool told_crash_ = false;
  std::uint64_t reboot_at_us_ = 0;  // 0 = no reboot asked for.
};

template <protocol::Message M>
void Dispatcher::reply(const Header& request, const M& message) noexcept {
  if (request.correlation == 0) {
    return;  // The host wants none.
  }
  const auto frame = output_.send(protocol::Channel::kControl, message, request.session, request.correlation);
  cache_.store(request, frame);
}

template <protocol::Message M>
void Dispatcher::decoded(const Frame& frame, void (Dispatcher::*handler)(const Header&, const M&)) noexcept {
  if (const auto message = frame.as<M>()) {
    (this->*handler)(frame.header(), *message);
  } else {
    reply_status(frame.header(), protocol::StatusCode::kInvalidArgument,
                 "payload ends inside a field or a list is too long");
  }
}

}  // namespace scatter::firmware
