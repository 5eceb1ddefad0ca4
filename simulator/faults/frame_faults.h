// Drops, damages, doubles and reorders the wire frames of one direction, by seed.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "simulator/faults/fault_plan.h"
#include "simulator/faults/fault_random.h"

namespace scatter::simulator {

/// How often each fault struck, in wire frames.
struct FaultCounts {
  std::uint64_t frames = 0;  ///< Seen, harmed or not.
  std::uint64_t dropped = 0;
  std::uint64_t corrupted = 0;
  std::uint64_t duplicated = 0;
  std::uint64_t reordered = 0;
  std::uint64_t truncated = 0;
  std::uint64_t garbage_bursts = 0;
};

/// One direction of a faulty link. The fate of frame n depends on (seed, direction, n) and on nothing
/// else, so that a run repeats exactly. Bytes that are no frame pass unharmed.
/// Memory    At most two frames. Threads: one.
class FrameFaults {
 public:
  /// A frame held back for reordering, or a cut one, goes on at the latest this long after it came.
  static constexpr std::uint64_t kHoldUs = 20'000;

  FrameFaults(const LinkRates& rates, std::uint64_t seed, Direction direction);

  /// Takes bytes of the stream at time `now_us` and appends to `out` what comes through.
  void pass(std::span<const std::byte> bytes, std::uint64_t now_us, std::vector<std::byte>& out);
  /// Appends what was held back for too long.
  void release_due(std::uint64_t now_us, std::vector<std::byte>& out);
  /// When release_due() will have something; absent: nothing is held.
  [[nodiscard]] std::optional<std::uint64_t> due_us() const noexcept;
  /// Forgets what is held (the link broke).
  void clear() noexcept;

  [[nodiscard]] const FaultCounts& counts() const noexcept { return counts_; }

 private:
  [[nodiscard]] std::array<std::uint32_t, 4> draw(FaultKey key, std::uint32_t part) const noexcept;
  [[nodiscard]] bool strikes(FaultKey key, double rate) const noexcept;
  void whole_frame(std::vector<std::byte> frame, std::uint64_t now_us, std::vector<std::byte>& out);
  void corrupt(std::span<std::byte> frame) const noexcept;

  LinkRates rates_;
  std::uint64_t seed_;
  Direction direction_;
  FaultCounts counts_;
  std::vector<std::byte> partial_;  ///< Start of a frame whose rest has not come.
  std::uint64_t partial_since_us_ = 0;
  std::vector<std::byte> held_;  ///< Whole frame waiting for its successor.
  std::uint64_t held_since_us_ = 0;
};

}  // namespace scatter::simulator
