// Crashes on request, and tells after the reset what the board remembers. One letter on the host's line says
// how; the answer to 'r' and the first words of each boot are a line of text:
//   reason present exception pc lr sp psr cfsr hfsr address uptime_us build_id
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include "firmware/boards/mps2_an500/devices.h"
#include "firmware/boards/mps2_an500/registers.h"
#include "firmware/boards/mps2_an500/sleep.h"
#include "firmware/boards/mps2_an500/startup.h"

namespace board = scatter::firmware::mps2_an500;

// Each crash in a function of its own, whose address the test knows from the symbol table.
extern "C" {
[[gnu::noinline]] void crash_undefined() {
  asm volatile("udf #7");
}
[[gnu::noinline]] std::uint32_t crash_division(std::uint32_t by) {
  std::uint32_t quotient = 0;
  asm volatile("udiv %0, %1, %2" : "=r"(quotient) : "r"(1000U), "r"(by));
  return quotient;
}
[[gnu::noinline]] void crash_no_memory() {
  board::write_register(0x9000'0000, 1);
}
[[gnu::noinline]] void crash_write_code() {
  volatile std::uint32_t vector = 0x100;  // The compiler takes a constant so low for a null pointer.
  board::write_register(vector, 1);
}
[[gnu::noinline]] void crash_write_factory() {
  board::write_register(0x6040'0000, 1);
}
[[gnu::noinline]] void crash_run_data() {
  asm volatile("bx %0" ::"r"(0x6000'0001U));
}
[[gnu::noinline]] std::uint32_t crash_stack(std::uint32_t depth) {
  volatile std::uint32_t room[32];
  for (std::uint32_t i = 0; i < 32; ++i) {
    room[i] = depth;
  }
  return depth == 0 ? 0 : crash_stack(depth + 1) + room[depth % 32];
}
[[gnu::noinline]] void crash_hang() {
  for (;;) {
    asm volatile("nop");
  }
}
[[gnu::noinline]] void crash_hang_deaf() {
  asm volatile("cpsid i" ::: "memory");
  for (;;) {
    asm volatile("nop");
  }
}
[[gnu::noinline]] void crash_interrupt() {
  board::enable_irq(20);  // Nobody handles it.
  board::pend_irq(20);
  board::barrier();
}
}

namespace {

class Line {
 public:
  Line& hex(std::uint64_t value) {
    char digits[16];
    std::size_t count = 0;
    do {
      digits[count++] = "0123456789abcdef"[value % 16];
      value /= 16;
    } while (value != 0);
    while (count > 0) {
      put(digits[--count]);
    }
    put(' ');
    return *this;
  }
  void text(std::string_view words) {
    for (const char c : words) {
      put(c);
    }
  }
  void put(char c) { bytes_[size_++ % bytes_.size()] = static_cast<std::byte>(c); }
  void send() {
    put('\n');
    (void)board::host_uart.write(std::span(bytes_).first(size_));
  }

 private:
  std::array<std::byte, 256> bytes_{};
  std::size_t size_ = 0;
};

void tell() {
  const scatter::protocol::FaultRecord record = board::last_crash();
  Line line;
  line.hex(static_cast<std::uint64_t>(board::reset_reason())).hex(record.present).hex(record.exception);
  line.hex(record.pc).hex(record.lr).hex(record.sp).hex(record.psr).hex(record.fault_status);
  line.hex(record.hard_fault_status).hex(record.fault_address).hex(record.uptime_us);
  line.text(record.build_id.str());
  line.send();
}

void obey(char letter) {
  // Long enough that a busy machine lets the emulator run between the first and the second timeout.
  constexpr std::uint32_t kWatchdogUs = 2'000'000;
  switch (letter) {
    case 'u':
      return crash_undefined();
    case 'd':
      (void)crash_division(0);
      return;
    case 'n':
      return crash_no_memory();
    case 'c':
      return crash_write_code();
    case 'f':
      return crash_write_factory();
    case 'x':
      return crash_run_data();
    case 's':
      (void)crash_stack(1);
      return;
    case 'i':
      return crash_interrupt();
    case 'w':
      board::BoardWatchdog::start(kWatchdogUs);
      return crash_hang();
    case 'm':
      board::BoardWatchdog::start(kWatchdogUs);
      return crash_hang_deaf();
    case 'b':
      board::restart();
    default:
      tell();
  }
}

}  // namespace

void run_image() noexcept {
  board::begin_boot();
  board::start_devices();
  board::name_running_image("crash image", 7);
  tell();
  for (;;) {
    std::array<std::byte, 1> letter{};
    if (board::host_uart.read(letter) == 1) {
      obey(static_cast<char>(letter[0]));
    }
  }
}
