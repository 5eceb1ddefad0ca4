#include "simulator/instrument/pace.h"

#include <algorithm>

#include "firmware/core/step.h"

namespace scatter::simulator {

std::uint64_t Pace::wait_us(std::uint64_t now_us, std::uint64_t wake_us, bool host_is_slow) {
  now_us_ = now_us;
  wake_us_ = wake_us;
  began_ = std::chrono::steady_clock::now();
  const std::uint64_t pause = wake_us > now_us ? wake_us - now_us : 0;
  if (host_is_slow) {
    passage_ = mode_ == ClockMode::kVirtual ? Passage::kStill : Passage::kByItself;
    // Time stands still: the next event never comes closer.
    return std::max<std::uint64_t>(pause, 1000);
  }
  if (mode_ == ClockMode::kReal) {
    passage_ = Passage::kByItself;
    return pause;
  }
  // Nothing is scheduled: the device sleeps until the host asks for something.
  const bool idle = pause >= firmware::kLongestSleepUs;
  passage_ = idle ? Passage::kWithComputer : Passage::kJump;
  return idle ? pause : 0;
}

std::optional<std::uint64_t> Pace::time_after_wait() const {
  switch (passage_) {
    case Passage::kByItself:
    case Passage::kStill:
      break;
    case Passage::kJump:
      return wake_us_;
    case Passage::kWithComputer: {
      const auto waited =
          std::chrono::duration_cast<std::chrono::microseconds>(std::chrono::steady_clock::now() - began_);
      return std::min(wake_us_, now_us_ + static_cast<std::uint64_t>(waited.count()));
    }
  }
  return std::nullopt;
}

}  // namespace scatter::simulator
