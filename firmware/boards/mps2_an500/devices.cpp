#include "firmware/boards/mps2_an500/devices.h"

#include "firmware/boards/mps2_an500/registers.h"
#include "firmware/boards/mps2_an500/sleep.h"
#include "firmware/boards/mps2_an500/startup.h"

namespace scatter::firmware::mps2_an500 {

constinit Uart host_uart{kUart0, kUart0ReceiveIrq, Wake::kEndOfFrame};
constinit Uart bench_uart{kUart1, kUart1ReceiveIrq, Wake::kEachByte};
constinit BoardClock board_clock;
constinit BoardReset board_reset;
constinit BoardWatchdog board_watchdog;

void start_devices() noexcept {
  board_clock.start();
  set_crash_clock(board_clock);
  set_handler(kUart0ReceiveIrq, [] { host_uart.on_receive(); });
  set_handler(kUart0TransmitIrq, [] { host_uart.on_transmit(); });
  set_handler(kUart1ReceiveIrq, [] { bench_uart.on_receive(); });
  set_handler(kUart1TransmitIrq, [] { bench_uart.on_transmit(); });
  set_handler(kTimer0Irq, on_alarm_interrupt);
  host_uart.start();
  bench_uart.start();
}

void restart() noexcept {
  constexpr std::uint64_t kGraceUs = 250'000;
  const std::uint64_t until = board_clock.now_us() + kGraceUs;
  while (!host_uart.drained() && board_clock.now_us() < until) {
  }
  announce_reset(protocol::ResetReason::kRequested);
  reset_system();
}

}  // namespace scatter::firmware::mps2_an500
