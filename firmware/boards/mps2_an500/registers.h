// Memory-mapped registers and where the parts of the AN500 board lie (Arm DAI 0500, "Application Note
// AN500").
#pragma once

#include <cstdint>

namespace scatter::firmware::mps2_an500 {

[[nodiscard]] inline std::uint32_t read_register(std::uint32_t address) noexcept {
  return *reinterpret_cast<volatile std::uint32_t*>(
      std::uintptr_t{address});  // NOLINT(performance-no-int-to-ptr)
}
inline void write_register(std::uint32_t address, std::uint32_t value) noexcept {
  *reinterpret_cast<volatile std::uint32_t*>(std::uintptr_t{address}) =
      value;  // NOLINT(performance-no-int-to-ptr)
}
/// Everything before it is done, in memory and in the pipeline.
inline void barrier() noexcept {
  asm volatile("dsb\n isb" ::: "memory");
}

inline constexpr std::uint32_t kCyclesPerUs = 25;  ///< Of the system clock, the counter and the timers.

inline constexpr std::uint32_t kTimer0 = 0x4000'0000;
inline constexpr std::uint32_t kUart0 = 0x4000'4000;
inline constexpr std::uint32_t kUart1 = 0x4000'5000;
inline constexpr std::uint32_t kWatchdogBase = 0x4000'8000;
inline constexpr std::uint32_t kCounter = 0x4002'8018;  ///< 25 MHz, 32 bit: wraps every 171.8 s.
inline constexpr std::uint32_t kI2c = 0x4002'A000;      ///< "Shield 1", two bare lines.

/// Numbers of the interrupts.
inline constexpr std::uint32_t kUart0ReceiveIrq = 0;
inline constexpr std::uint32_t kUart0TransmitIrq = 1;
inline constexpr std::uint32_t kUart1ReceiveIrq = 2;
inline constexpr std::uint32_t kUart1TransmitIrq = 3;
inline constexpr std::uint32_t kTimer0Irq = 8;
inline constexpr std::uint32_t kIrqs = 32;

/// Interrupts below 32, all of one priority.
inline void enable_irq(std::uint32_t irq) noexcept {
  write_register(0xE000'E100, 1U << irq);
}
inline void disable_irq(std::uint32_t irq) noexcept {
  write_register(0xE000'E180, 1U << irq);
  barrier();
}
/// As if the device had asked for it.
inline void pend_irq(std::uint32_t irq) noexcept {
  write_register(0xE000'E200, 1U << irq);
}

/// Restarts the processor and every part of the board; memory stays.
[[noreturn]] inline void reset_system() noexcept {
  barrier();
  write_register(0xE000'ED0C, 0x05FA'0004U);
  for (;;) {
    barrier();
  }
}

}  // namespace scatter::firmware::mps2_an500
