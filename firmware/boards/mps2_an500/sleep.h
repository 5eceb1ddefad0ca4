// The main loop's rest: until something happens or until a time, without losing a wake-up.
#pragma once

#include <cstdint>

#include "firmware/boards/mps2_an500/board_clock.h"

namespace scatter::firmware::mps2_an500 {

/// There is something to do. For interrupts, and for the main loop itself.
void note_activity() noexcept;

/// Returns at once when note_activity() was called since the last return; else rests (WFI) until it is
/// or until `wake_at_us`.
void sleep_until(BoardClock& clock, std::uint64_t wake_at_us) noexcept;

/// Timer 0's interrupt.
void on_alarm_interrupt() noexcept;

}  // namespace scatter::firmware::mps2_an500
