// What one turn of the firmware's main loop did, and when the next one is due.
#pragma once

#include <cstdint>

namespace scatter::firmware {

/// Longest time between two polls [us]; the board's watchdog must be slower than this.
inline constexpr std::uint64_t kLongestSleepUs = 1'000'000;

struct Step {
  bool did_work =
      false;  ///< True: poll again at once. False: nothing to do before wake_at_us or link traffic.
  /// Device time [us] at which something is due; never later than kLongestSleepUs from now, so that the
  /// watchdog stays fed. The board may poll earlier; it must when bytes arrive or the link has room again.
  std::uint64_t wake_at_us = 0;
};

}  // namespace scatter::firmware
