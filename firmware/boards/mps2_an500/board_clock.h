// Time since this image started, from a counter that wraps every 171.8 s.
#pragma once

#include <cstdint>

#include "firmware/ports/ports.h"

namespace scatter::firmware::mps2_an500 {

/// Exact as long as now_us() is called at least once in 171 s; the main loop calls it every second.
class BoardClock final : public Clock {
 public:
  constexpr BoardClock() noexcept = default;

  /// The counter's present reading becomes time 0.
  void start() noexcept;
  [[nodiscard]] std::uint64_t now_us() noexcept override;
  /// now_us() for a crash handler: changes nothing, may be off if it interrupted now_us().
  [[nodiscard]] std::uint64_t peek_us() const noexcept;

 private:
  std::uint64_t ticks_ = 0;
  std::uint32_t last_ = 0;
};

}  // namespace scatter::firmware::mps2_an500
