// How a server of a virtual instrument lets time pass: one rule for every carrier.
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>

#include "simulator/instrument/virtual_clock.h"

namespace scatter::simulator {

/// The loop: run the instrument; ask wait_us(); wait so long for the host at most; move the clock to
/// time_after_wait().
///
/// Rule      Real clock: time passes by itself, and the wait ends when the instrument has something to do.
///           Virtual clock: from event to event without waiting while the instrument has something to do;
///           with the computer's clock while it waits for the host (nothing is due for kLongestSleepUs); not
///           at all while the host does not take what was sent, so that a slow host loses nothing.
/// Threads   one.
class Pace {
 public:
  explicit Pace(ClockMode mode) noexcept : mode_(mode) {}

  /// Longest wait for the host [us]; 0: look at its requests without waiting.
  /// `now_us`, `wake_us`  the instrument's time, and when it has more to do (VirtualInstrument::run_ready).
  /// `host_is_slow`       bytes wait because the host does not take them.
  [[nodiscard]] std::uint64_t wait_us(std::uint64_t now_us, std::uint64_t wake_us, bool host_is_slow);

  /// The instrument's time after the wait that began with wait_us() [us]; nothing: the clock is left alone.
  [[nodiscard]] std::optional<std::uint64_t> time_after_wait() const;

 private:
  enum class Passage : std::uint8_t { kByItself, kJump, kWithComputer, kStill };

  ClockMode mode_;
  Passage passage_ = Passage::kByItself;
  std::uint64_t now_us_ = 0;
  std::uint64_t wake_us_ = 0;
  std::chrono::steady_clock::time_point began_;
};

}  // namespace scatter::simulator
