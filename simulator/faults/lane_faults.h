// One direction of a carrier, as the fault plan wants it: harmed frames, stalls, breaks.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "simulator/faults/fault_plan.h"
#include "simulator/faults/frame_faults.h"

namespace scatter::simulator {

/// Two edges: bytes enter by carry(), where frames are harmed, and leave over the edge that counts them:
/// allowed() says how many may, crossed() that they did. Positions of stalls and breaks count from power-on
/// and survive clear(). Times are the caller's, since power-on. Threads: one.
class LaneFaults {
 public:
  LaneFaults(const FaultPlan& plan, std::uint64_t seed, Direction direction);

  /// Frames are harmed: bytes must go through carry(). Else they may go past it.
  [[nodiscard]] bool harms_frames() const noexcept { return harms_frames_; }
  /// Appends to `out` what comes through of `bytes`.
  void carry(std::span<const std::byte> bytes, std::uint64_t now_us, std::vector<std::byte>& out);
  /// Appends what was held back for too long. Call it whenever time has moved.
  void release_due(std::uint64_t now_us, std::vector<std::byte>& out) { frames_.release_due(now_us, out); }

  /// How many of `wanted` bytes may cross now. A stall's time begins when it first says 0.
  [[nodiscard]] std::size_t allowed(std::size_t wanted, std::uint64_t now_us);
  /// Counts bytes that crossed. True: the carrier breaks here, as the plan says; once per position.
  [[nodiscard]] bool crossed(std::size_t count);

  /// When something changes by itself: a stall ends, a held frame goes on.
  [[nodiscard]] std::optional<std::uint64_t> next_event_us() const noexcept;
  /// Forgets what is held (the carrier broke).
  void clear() noexcept { frames_.clear(); }
  [[nodiscard]] const FaultCounts& counts() const noexcept { return frames_.counts(); }

 private:
  struct StallState {
    Stall stall;
    std::optional<std::uint64_t> began_us;
    bool over = false;
  };

  FrameFaults frames_;
  bool harms_frames_;
  std::uint64_t passed_ = 0;  ///< Bytes that crossed since power-on.
  std::vector<StallState> stalls_;
  std::vector<std::uint64_t> disconnects_;  ///< Positions still to come.
};

}  // namespace scatter::simulator
