// The board's parts, in static memory, and what all images do with them first.
#pragma once

#include "firmware/boards/mps2_an500/board_clock.h"
#include "firmware/boards/mps2_an500/board_watchdog.h"
#include "firmware/boards/mps2_an500/kept_memory.h"
#include "firmware/boards/mps2_an500/uart.h"

namespace scatter::firmware::mps2_an500 {

/// The host's line and the bench's. Shared with their interrupts.
extern constinit Uart host_uart;
extern constinit Uart bench_uart;
extern constinit BoardClock board_clock;
extern constinit BoardReset board_reset;
extern constinit BoardWatchdog board_watchdog;

/// Clock, crash snapshots, both lines and the alarm of sleep_until. The first thing in run_image().
void start_devices() noexcept;

/// Lets the host's line run dry, for at most 250 ms, then resets the system; the next boot reports
/// kRequested.
[[noreturn]] void restart() noexcept;

}  // namespace scatter::firmware::mps2_an500
