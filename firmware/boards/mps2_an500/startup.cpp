#include "firmware/boards/mps2_an500/startup.h"

#include <array>
#include <cstddef>
#include <cstring>

#include "firmware/boards/mps2_an500/kept_memory.h"
#include "firmware/boards/mps2_an500/registers.h"

// NOLINTBEGIN(bugprone-reserved-identifier): names of linker scripts.
extern "C" {
extern std::byte __data_start[];
extern std::byte __data_end[];
extern const std::byte __data_load[];
extern std::byte __bss_start[];
extern std::byte __bss_end[];
extern std::byte __stack_top[];
[[noreturn]] void reset_handler();
void crash_entry();
void interrupt_entry();
[[noreturn]] void crash(const std::uint32_t* stack, std::uint32_t exception_return) noexcept;
/// The language's handler for a call of a function that no class defined.
[[noreturn]] void __cxa_pure_virtual();
}
// NOLINTEND(bugprone-reserved-identifier)

namespace scatter::firmware::mps2_an500 {
namespace {

constinit std::array<InterruptHandler, kIrqs> handlers{};
constinit const BoardClock* crash_clock = nullptr;

using Handler = void (*)();
struct VectorTable {
  std::byte* stack;
  std::array<Handler, 15> exceptions;  // From reset (1) to SysTick (15).
  std::array<Handler, kIrqs> interrupts;
};

[[nodiscard]] constexpr std::array<Handler, kIrqs> one_for_all(Handler handler) noexcept {
  std::array<Handler, kIrqs> table{};
  table.fill(handler);
  return table;
}

}  // namespace

// What nobody uses is a crash as well: an exception that comes anyway must not go unseen. 2 (NMI) is the
// watchdog's first timeout, 3..6 are the faults.
[[gnu::section(".vectors"), gnu::used]] constinit const VectorTable vector_table{
    __stack_top,
    {reset_handler, crash_entry, crash_entry, crash_entry, crash_entry, crash_entry, nullptr, nullptr,
     nullptr, nullptr, crash_entry, crash_entry, nullptr, crash_entry, crash_entry},
    one_for_all(interrupt_entry)};

void set_handler(std::uint32_t irq, InterruptHandler handler) noexcept {
  handlers[irq] = handler;
}

void set_crash_clock(const BoardClock& clock) noexcept {
  crash_clock = &clock;
}

}  // namespace scatter::firmware::mps2_an500

namespace board = scatter::firmware::mps2_an500;

// Faults and the watchdog come here. The stack may be the reason: the handler runs on one of its own. Nothing
// nests on it: a fault in here locks the processor up, and the watchdog ends that.
[[gnu::naked, gnu::used]] void crash_entry() {
  asm volatile(
      "mrs r0, msp\n"
      "mov r1, lr\n"
      "ldr r2, =__crash_stack_top\n"
      "msr msp, r2\n"
      "b crash\n"
      ".ltorg\n");
}

void interrupt_entry() {
  std::uint32_t exception = 0;
  asm volatile("mrs %0, ipsr" : "=r"(exception));
  const board::InterruptHandler handler = board::handlers[(exception - 16) % board::kIrqs];
  if (handler == nullptr) {
    asm volatile("udf #1");
    return;
  }
  handler();
}

void __cxa_pure_virtual() {
  asm volatile("udf #2");
  for (;;) {
  }
}

extern "C" {
extern const std::byte __stack_guard[];  // NOLINT(bugprone-reserved-identifier)
}

void crash(const std::uint32_t* stack, std::uint32_t exception_return) noexcept {
  constexpr std::uint32_t kWatchdogException = 2;
  constexpr std::uint32_t kStackingFailed = 1U << 4U | 1U << 12U;  // MSTKERR, STKERR
  constexpr std::uint32_t kMemoryAddressValid = 1U << 7U;
  constexpr std::uint32_t kBusAddressValid = 1U << 15U;
  constexpr std::uint32_t kExtendedFrame = 1U << 4U;  // Clear: floating-point registers were pushed, too.
  constexpr std::uint32_t kStackGuardBytes = 256;
  board::CrashState state;
  std::uint32_t exception = 0;
  asm volatile("mrs %0, ipsr" : "=r"(exception));
  state.exception = exception;
  state.reason = exception == kWatchdogException ? scatter::protocol::ResetReason::kWatchdog
                                                 : scatter::protocol::ResetReason::kFault;
  state.fault_status = board::read_register(0xE000'ED28);
  state.hard_fault_status = board::read_register(0xE000'ED2C);
  if ((state.fault_status & kMemoryAddressValid) != 0) {
    state.fault_address = board::read_register(0xE000'ED34);
  } else if ((state.fault_status & kBusAddressValid) != 0) {
    state.fault_address = board::read_register(0xE000'ED38);
  }
  // A frame that could not be pushed must not be read: there is none, and reading the guard is the next
  // fault.
  const auto at = reinterpret_cast<std::uintptr_t>(stack);
  const auto lowest = reinterpret_cast<std::uintptr_t>(__stack_guard) + kStackGuardBytes;
  const auto highest = reinterpret_cast<std::uintptr_t>(__stack_top);
  state.sp = at;
  if ((state.fault_status & kStackingFailed) == 0 && at >= lowest && at + 32 <= highest) {
    state.lr = stack[5];
    state.pc = stack[6];
    state.psr = stack[7];
    const bool extended = (exception_return & kExtendedFrame) == 0;
    const bool aligned = (state.psr & (1U << 9U)) != 0;  // The processor put 4 bytes in between.
    state.sp = at + (extended ? 104U : 32U) + (aligned ? 4U : 0U);
  }
  board::record_crash(state, board::crash_clock == nullptr ? 0 : board::crash_clock->peek_us());
  board::reset_system();
}

void reset_handler() {
  // Floating point first: the compiler may use its registers anywhere.
  board::write_register(0xE000'ED88, board::read_register(0xE000'ED88) | 0xFU << 20U);
  board::barrier();
  std::memcpy(__data_start, __data_load, static_cast<std::size_t>(__data_end - __data_start));
  std::memset(__bss_start, 0, static_cast<std::size_t>(__bss_end - __bss_start));
  board::protect_memory();
  asm volatile("cpsie i" ::: "memory");
  run_image();
}
