#include "firmware/boards/mps2_an500/i2c_bus.h"

#include "firmware/boards/mps2_an500/registers.h"

namespace scatter::firmware::mps2_an500 {
namespace {

constexpr std::uint32_t kSet = kI2c;        // Writing lets a line go high; reading gives the lines.
constexpr std::uint32_t kClear = kI2c + 4;  // Writing pulls a line low.
constexpr std::uint32_t kClock = 1U << 0U;
constexpr std::uint32_t kData = 1U << 1U;

void clock(bool high) noexcept {
  write_register(high ? kSet : kClear, kClock);
}
void data(bool high) noexcept {
  write_register(high ? kSet : kClear, kData);
}
[[nodiscard]] bool sample() noexcept {
  return (read_register(kSet) & kData) != 0;
}

void start() noexcept {
  data(true);
  clock(true);
  data(false);
  clock(false);
}
void stop() noexcept {
  data(false);
  clock(true);
  data(true);
}

/// True when the part acknowledged.
[[nodiscard]] bool send(std::byte value) noexcept {
  for (std::uint32_t bit = 8; bit-- > 0;) {
    data((static_cast<std::uint32_t>(value) >> bit & 1U) != 0);
    clock(true);
    clock(false);
  }
  data(true);
  clock(true);
  const bool acknowledged = !sample();
  clock(false);
  return acknowledged;
}
[[nodiscard]] bool send(std::span<const std::byte> bytes) noexcept {
  for (const std::byte value : bytes) {
    if (!send(value)) {
      return false;
    }
  }
  return true;
}

[[nodiscard]] std::byte receive(bool more) noexcept {
  std::uint32_t value = 0;
  data(true);
  for (int bit = 0; bit < 8; ++bit) {
    clock(true);
    value = value << 1U | (sample() ? 1U : 0U);
    clock(false);
  }
  data(!more);
  clock(true);
  clock(false);
  return static_cast<std::byte>(value);
}

[[nodiscard]] std::byte to_write(std::uint8_t address) noexcept {
  return static_cast<std::byte>(address << 1U);
}
[[nodiscard]] std::byte to_read(std::uint8_t address) noexcept {
  return static_cast<std::byte>(address << 1U | 1U);
}

}  // namespace

bool I2cBus::write(std::uint8_t address, std::span<const std::byte> head,
                   std::span<const std::byte> bytes) noexcept {
  start();
  const bool done = send(to_write(address)) && send(head) && send(bytes);
  stop();
  return done;
}

bool I2cBus::read(std::uint8_t address, std::span<const std::byte> head, std::span<std::byte> out) noexcept {
  start();
  bool done = send(to_write(address)) && send(head);
  if (done) {
    start();
    done = send(to_read(address));
  }
  for (std::size_t i = 0; done && i < out.size(); ++i) {
    out[i] = receive(i + 1 < out.size());
  }
  stop();
  return done;
}

void I2cBus::recover() noexcept {
  data(true);
  for (int i = 0; i < 9; ++i) {
    clock(true);
    clock(false);
  }
  stop();
}

}  // namespace scatter::firmware::mps2_an500
