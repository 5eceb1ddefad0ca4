// The frames of one run, with a ledger that says where every exposure went.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>

#include "host_sdk/device/frame.h"
#include "host_sdk/device/wait.h"
#include "host_sdk/error/error.h"
#include "protocol/messages.h"

namespace scatter::device {

/// What the host saw on the link during a run.
struct LinkStatistics {
  std::uint64_t bytes = 0;               ///< Received, wire frames only.
  std::uint64_t wire_frames = 0;         ///< Valid ones of this session.
  std::uint64_t bad_frames = 0;          ///< Header or payload checksum wrong.
  std::uint64_t skipped_bytes = 0;       ///< Passed over while looking for a frame.
  std::uint64_t stale_frames = 0;        ///< Of an earlier session; discarded.
  std::uint64_t duplicate_chunks = 0;    ///< Dropped, contents already there.
  std::uint64_t unrequested_chunks = 0;  ///< Beyond the credit, of another run, or malformed; dropped.
  std::uint64_t incomplete_frames = 0;   ///< Delivered with status kIncomplete (in lost_link).
  /// Bytes of wire frames that came in pieces and were copied to put them together; 0 where the carrier keeps
  /// frames whole. Beside these, each pixel is copied once: from the carrier's buffer into its frame.
  std::uint64_t copied_bytes = 0;
  std::uint64_t pixel_bytes = 0;  ///< Copied into frames.
  std::uint64_t carrier_stalls = 0;
  std::uint64_t carrier_overflows = 0;  ///< What CarrierStatistics says of them.
  std::uint64_t carrier_errors = 0;
};

/// How a run ended. `ledger.balances()` is true for every honest device, whatever the link did.
struct RunSummary {
  std::uint32_t run_id = 0;
  protocol::RunEnd reason = protocol::RunEnd::kCompleted;
  bool device_reported = false;  ///< False: the device vanished; `exposed` is what the host knows of.
  protocol::Ledger ledger;       ///< The device's half completed by the host's.
  std::uint32_t frames_sent = 0;
  std::uint64_t started_us = 0;  ///< Device's clock.
  std::uint64_t ended_us = 0;
  std::uint64_t held_us = 0;  ///< Time the device waited for the host's credit.
  LinkStatistics link;
};

/// Frames of one run in order of completion (frame id order unless the link reorders).
///
/// Credits are granted ahead automatically: the device never has more than StartOptions'
/// credit_window frames under way, so memory is bounded by window x frame size plus the frames that
/// the caller keeps. While the caller does not call next(), the device holds.
///
/// Threads  one thread, the Device's; request_stop() may be called from any.
/// End      destroying a running stream aborts the run on the device, within 1 s.
class Stream {
 public:
  Stream(Stream&&) noexcept;
  Stream& operator=(Stream&&) noexcept;
  ~Stream();

  /// Next frame, complete or not (look at `status`); nullopt = the run is finished and every frame
  /// was handed out, summary() is final.
  /// Errors  kDeadlineExceeded: nothing came within wait.timeout, the run goes on, call again;
  ///         kAborted: wait.stop; kDisconnected: the device is gone, frames received before are
  ///         handed out first; the recorder's error (full disk): the run goes on unrecorded, abort it.
  [[nodiscard]] Result<std::optional<Frame>> next(const Wait& wait = {});

  /// Asks for the end after the frame in hand; next() goes on to hand out what is on the way, then
  /// nullopt. Returns at once. Any thread, signal handlers excepted.
  void request_stop() noexcept;

  /// Ends the run after the frame in hand and waits for the device's report. Frames that arrived are
  /// still handed out by next().
  [[nodiscard]] Status stop(const Wait& wait = {});

  /// Ends the run now. Frames not handed out yet are dropped and counted as lost_host.
  [[nodiscard]] Result<RunSummary> abort(const Wait& wait = {});

  /// Final after next() gave nullopt or abort() succeeded; what is known so far before.
  [[nodiscard]] RunSummary summary() const;
  [[nodiscard]] const protocol::Started& started() const noexcept;

  struct State;

 private:
  friend class Device;
  explicit Stream(std::unique_ptr<State> state) noexcept;
  std::unique_ptr<State> state_;
};

}  // namespace scatter::device
