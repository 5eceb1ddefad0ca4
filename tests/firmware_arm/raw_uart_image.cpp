// What the host's line itself can do, for comparison with the protocol's throughput. One letter and a number
// (u32, little endian) come over the line:
//   'T' n  the board sends n bytes 0, 1, 2, ... as fast as its driver can
//   'R' n  the board takes n bytes, then sends one byte: their sum modulo 256
//   'E' n  the board sends back each of n bytes
//   'P' n  as 'T' by polling the registers, without driver and interrupts
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "firmware/boards/mps2_an500/devices.h"
#include "firmware/boards/mps2_an500/registers.h"
#include "firmware/boards/mps2_an500/sleep.h"
#include "firmware/boards/mps2_an500/startup.h"
#include "protocol/endian.h"

namespace board = scatter::firmware::mps2_an500;

namespace {

constinit std::array<std::byte, 1024> buffer{};

void rest() {
  board::sleep_until(board::board_clock, board::board_clock.now_us() + 10'000);
}

void take(std::span<std::byte> out) {
  while (!out.empty()) {
    out = out.subspan(board::host_uart.read(out));
  }
}

void give(std::span<const std::byte> bytes) {
  while (!bytes.empty()) {
    const std::size_t count = board::host_uart.write(bytes);
    bytes = bytes.subspan(count);
    if (count == 0) {
      rest();
    }
  }
}

void transmit(std::uint32_t count) {
  for (std::size_t i = 0; i < buffer.size(); ++i) {
    buffer[i] = static_cast<std::byte>(i);
  }
  while (count > 0) {
    const auto size = std::min<std::uint32_t>(count, buffer.size());
    give(std::span(buffer).first(size));
    count -= size;
  }
}

void poll_out(std::uint32_t count) {
  while (!board::host_uart.drained()) {
  }
  for (std::uint32_t i = 0; i < count; ++i) {
    while ((board::read_register(board::kUart0 + 4) & 1U) != 0) {
    }
    board::write_register(board::kUart0, i & 0xFFU);
  }
}

void receive(std::uint32_t count, bool echo) {
  std::uint32_t sum = 0;
  while (count > 0) {
    const std::size_t got =
        board::host_uart.read(std::span(buffer).first(std::min<std::size_t>(count, buffer.size())));
    if (echo) {
      give(std::span(buffer).first(got));
    }
    for (std::size_t i = 0; i < got; ++i) {
      sum += static_cast<std::uint32_t>(buffer[i]);
    }
    count -= static_cast<std::uint32_t>(got);
  }
  if (!echo) {
    const std::array<std::byte, 1> answer{static_cast<std::byte>(sum)};
    give(answer);
  }
}

}  // namespace

void run_image() noexcept {
  board::begin_boot();
  board::start_devices();
  for (;;) {
    std::array<std::byte, 5> command{};
    take(command);
    const auto count = scatter::protocol::load_le<std::uint32_t>(command.data() + 1);
    switch (static_cast<char>(command[0])) {
      case 'T':
        transmit(count);
        break;
      case 'P':
        poll_out(count);
        break;
      default:
        receive(count, command[0] == std::byte{'E'});
    }
  }
}
