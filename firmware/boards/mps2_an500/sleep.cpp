#include "firmware/boards/mps2_an500/sleep.h"

#include <algorithm>
#include <atomic>

#include "firmware/boards/mps2_an500/registers.h"

namespace scatter::firmware::mps2_an500 {
namespace {

constexpr std::uint32_t kControl = kTimer0;
constexpr std::uint32_t kValue = kTimer0 + 4;
constexpr std::uint32_t kReload = kTimer0 + 8;
constexpr std::uint32_t kClear = kTimer0 + 12;
constexpr std::uint32_t kEnableWithInterrupt = 1U | 1U << 3U;
constexpr std::uint64_t kLongestAlarmUs = 10'000'000;

constinit std::atomic<bool> activity{false};
constinit std::atomic<bool> alarm_rang{false};

void set_alarm(std::uint64_t in_us) noexcept {
  write_register(kControl, 0);
  write_register(kClear, 1);
  alarm_rang.store(false, std::memory_order_release);
  write_register(kReload, 0);  // Fires once.
  const auto ticks = static_cast<std::uint32_t>(std::min(in_us, kLongestAlarmUs) * kCyclesPerUs);
  write_register(kValue, std::max<std::uint32_t>(ticks, 1));
  write_register(kControl, kEnableWithInterrupt);
  enable_irq(kTimer0Irq);
}

}  // namespace

void note_activity() noexcept {
  activity.store(true, std::memory_order_release);
}

void sleep_until(BoardClock& clock, std::uint64_t wake_at_us) noexcept {
  const std::uint64_t now = clock.now_us();
  if (wake_at_us <= now) {
    return;
  }
  set_alarm(wake_at_us - now);
  // With interrupts masked nothing can come between the test and WFI; a pending interrupt ends WFI anyway.
  // Every byte of a frame comes by here, so the clock's register is left alone: the alarm says when it is
  // time.
  for (;;) {
    asm volatile("cpsid i" ::: "memory");
    if (activity.exchange(false, std::memory_order_acq_rel) || alarm_rang.load(std::memory_order_acquire)) {
      break;
    }
    asm volatile("dsb\n wfi\n cpsie i\n isb" ::: "memory");
  }
  asm volatile("cpsie i" ::: "memory");
  write_register(kControl, 0);
}

void on_alarm_interrupt() noexcept {
  write_register(kClear, 1);
  alarm_rang.store(true, std::memory_order_release);
}

}  // namespace scatter::firmware::mps2_an500
