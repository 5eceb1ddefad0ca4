#include "firmware/boards/mps2_an500/board_clock.h"

#include "firmware/boards/mps2_an500/registers.h"

namespace scatter::firmware::mps2_an500 {

void BoardClock::start() noexcept {
  ticks_ = 0;
  last_ = read_register(kCounter);
}

std::uint64_t BoardClock::now_us() noexcept {
  const std::uint32_t counter = read_register(kCounter);
  ticks_ += counter - last_;  // Modulo 2^32: right across the wrap.
  last_ = counter;
  return ticks_ / kCyclesPerUs;
}

std::uint64_t BoardClock::peek_us() const noexcept {
  return (ticks_ + (read_register(kCounter) - last_)) / kCyclesPerUs;
}

}  // namespace scatter::firmware::mps2_an500
