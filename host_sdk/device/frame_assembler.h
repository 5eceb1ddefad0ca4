// Frames put together again from the chunks of the wire.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "host_sdk/device/frame.h"
#include "host_sdk/device/pixel_pool.h"
#include "protocol/crc.h"
#include "protocol/frame.h"

namespace scatter::device {

/// What an assembler accepts.
struct AssemblerLimits {
  /// Largest frame [B]; one that claims more is refused.
  std::uint32_t max_frame_bytes = 64U << 20U;
  /// Frame ids that were granted: before this one. Others are refused. Unset: all.
  std::optional<std::uint32_t> until;
  /// Frames open at once; one more settles the oldest.
  std::size_t max_open = 64;
  /// The run that is meant. Unknown: the first stream message's, except ids not after `after_run`.
  std::optional<std::uint32_t> run_id;
  std::optional<std::uint32_t> after_run;
  /// Settings that every frame must have been taken with.
  std::optional<std::uint32_t> epoch;
};

struct AssemblerCounters {
  std::uint64_t complete = 0;
  std::uint64_t corrupt = 0;
  std::uint64_t incomplete = 0;
  std::uint64_t ends_seen = 0;           ///< Distinct frames whose end arrived.
  std::uint64_t duplicate_chunks = 0;    ///< Contents already there, or the frame was settled before.
  std::uint64_t unrequested_chunks = 0;  ///< Beyond the credit, of another run, or malformed.
  std::uint64_t pixel_bytes = 0;         ///< Copied into frames.
};

/// Promises:
/// - frames come out in rising frame id, each once; complete only when begin, every byte and end are
///   there and agree (size, settings epoch, checksum over the pixels);
/// - chunks are placed by their offset in any order; what is there already is never overwritten;
/// - a frame that misses something is settled as incomplete when a frame two ids later is whole, when
///   max_open frames are open, or by flush(); a gap is never patched: its bytes are zero and listed;
/// - memory is bounded by (max_open + frames not taken yet) x max_frame_bytes.
class FrameAssembler {
 public:
  FrameAssembler(std::shared_ptr<PixelPool> pool, const AssemblerLimits& limits);
  ~FrameAssembler();
  FrameAssembler(const FrameAssembler&) = delete;
  FrameAssembler& operator=(const FrameAssembler&) = delete;

  /// Takes one message of the stream channel; others are counted as unrequested.
  void accept(const protocol::Frame& wire, std::uint64_t host_time_unix_ns);
  /// Settles everything that is open.
  void flush();
  /// Settles everything before `frame_id`, seen or not; such frames are refused from now on.
  void skip_to(std::uint32_t frame_id);
  void set_until(std::uint32_t frame_id) noexcept { limits_.until = frame_id; }
  void set_run(std::uint32_t run_id) noexcept { limits_.run_id = run_id; }

  /// The next settled frame.
  [[nodiscard]] std::optional<Frame> pop();
  [[nodiscard]] std::size_t ready() const noexcept { return ready_.size(); }
  [[nodiscard]] std::size_t open() const noexcept { return open_.size(); }
  /// One past the highest frame id that anything arrived of; 0 when nothing did.
  [[nodiscard]] std::uint32_t seen_until() const noexcept { return seen_until_; }
  /// One past the last settled frame.
  [[nodiscard]] std::uint32_t settled_until() const noexcept { return settled_until_; }
  [[nodiscard]] std::optional<std::uint32_t> run() const noexcept { return limits_.run_id; }
  [[nodiscard]] const AssemblerCounters& counters() const noexcept { return counters_; }

 private:
  struct Open;
  [[nodiscard]] bool of_this_run(std::uint32_t run_id) noexcept;
  [[nodiscard]] Open* find_or_open(std::uint32_t frame_id);
  void place(Open& frame, const protocol::FrameData& data, const protocol::Frame& wire);
  void settle_if_whole(Open& frame);
  void settle_front();
  void advance();

  std::shared_ptr<PixelPool> pool_;
  AssemblerLimits limits_;
  AssemblerCounters counters_;
  protocol::TailCrc tail_crc_;
  std::deque<std::unique_ptr<Open>> open_;  ///< Rising frame id.
  std::deque<Frame> ready_;
  std::uint32_t settled_until_ = 0;
  std::uint32_t seen_until_ = 0;
};

}  // namespace scatter::device
