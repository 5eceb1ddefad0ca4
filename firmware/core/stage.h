// The optional motorised stage: knows what lies under the instrument, or that nobody knows.
#pragma once

#include <cstdint>
#include <optional>

#include "firmware/ports/ports.h"

namespace scatter::firmware {

class Stage {
 public:
  explicit Stage(ReferenceStage* port) noexcept : port_(port) {}

  [[nodiscard]] bool present() const noexcept { return port_ != nullptr; }

  enum class Move : std::uint8_t { kThere, kMoving, kNoSuchTarget };
  /// Brings `target` under the instrument. Only with a stage present.
  [[nodiscard]] Move move_to(protocol::Target target) noexcept {
    if (!moving() && target_ == target) {
      return Move::kThere;
    }
    if (!port_->move_to(target)) {
      return Move::kNoSuchTarget;
    }
    target_ = target;
    return port_->moving() ? Move::kMoving : Move::kThere;
  }
  [[nodiscard]] bool moving() const noexcept { return port_ != nullptr && port_->moving(); }
  /// Device time at which it stands still; 0 = unknown or still.
  [[nodiscard]] std::uint64_t settled_at_us() const noexcept { return moving() ? port_->settled_at_us() : 0; }

 private:
  ReferenceStage* port_;
  std::optional<protocol::Target> target_;  // Unknown until the first move.
};

}  // namespace scatter::firmware
