// From reset to main, and what a crash does.
#pragma once

#include <cstdint>

#include "firmware/boards/mps2_an500/board_clock.h"

namespace scatter::firmware::mps2_an500 {

/// An interrupt's handler; null is a crash (an interrupt that nobody asked for).
using InterruptHandler = void (*)();
/// Sets the handler of interrupt `irq` (below kIrqs).
void set_handler(std::uint32_t irq, InterruptHandler handler) noexcept;

/// Whose time goes into a snapshot; none until set.
void set_crash_clock(const BoardClock& clock) noexcept;

/// Makes code read-only and everything else no-execute, puts the guard below the stack, and turns crashes
/// into faults of their own kind. Called before main; images at address 0 see both slots as data.
void protect_memory() noexcept;
/// Turns protection off: the next image brings its own.
void unprotect_memory() noexcept;

}  // namespace scatter::firmware::mps2_an500

/// The image's program. Never returns.
[[noreturn]] void run_image() noexcept;
