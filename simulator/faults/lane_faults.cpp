#include "simulator/faults/lane_faults.h"

#include <algorithm>

namespace scatter::simulator {

LaneFaults::LaneFaults(const FaultPlan& plan, std::uint64_t seed, Direction direction)
    : frames_(plan.rates(direction), seed, direction), harms_frames_(plan.rates(direction).any()) {
  for (const Stall& stall : plan.stalls) {
    if (stall.direction == direction) {
      stalls_.push_back({.stall = stall, .began_us = {}, .over = false});
    }
  }
  for (const Disconnect& disconnect : plan.disconnects) {
    if (disconnect.direction == direction) {
      disconnects_.push_back(disconnect.at_byte);
    }
  }
}

void LaneFaults::carry(std::span<const std::byte> bytes, std::uint64_t now_us, std::vector<std::byte>& out) {
  if (harms_frames_) {
    frames_.pass(bytes, now_us, out);
  } else {
    out.insert(out.end(), bytes.begin(), bytes.end());
  }
}

std::size_t LaneFaults::allowed(std::size_t wanted, std::uint64_t now_us) {
  std::size_t count = wanted;
  for (StallState& state : stalls_) {
    if (state.began_us && state.stall.duration_us && now_us >= *state.began_us + *state.stall.duration_us) {
      state.over = true;
    }
    if (state.over) {
      continue;
    }
    if (passed_ >= state.stall.at_byte) {
      if (!state.began_us) {
        state.began_us = now_us;
      }
      return 0;
    }
    count = std::min<std::size_t>(count, state.stall.at_byte - passed_);
  }
  for (const std::uint64_t position : disconnects_) {
    count = std::min<std::size_t>(count, position - std::min(position, passed_));
  }
  return count;
}

bool LaneFaults::crossed(std::size_t count) {
  passed_ += count;
  return std::erase_if(disconnects_, [this](std::uint64_t position) { return passed_ >= position; }) > 0;
}

std::optional<std::uint64_t> LaneFaults::next_event_us() const noexcept {
  std::optional<std::uint64_t> next = frames_.due_us();
  for (const StallState& state : stalls_) {
    if (state.began_us && !state.over && state.stall.duration_us) {
      const std::uint64_t end = *state.began_us + *state.stall.duration_us;
      next = next ? std::min(*next, end) : end;
    }
  }
  return next;
}

}  // namespace scatter::simulator
