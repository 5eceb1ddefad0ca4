// I2C master on two bare lines of the board ("Shield 1"): the processor moves every edge itself.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace scatter::firmware::mps2_an500 {

/// Stateless; calls block for the transfer (about 30 register accesses a byte). False = a part did not
/// acknowledge; the bus is free again then. Clock stretching is not awaited: no part of this board does it.
class I2cBus {
 public:
  /// Start, write `head`, then `bytes`, stop.
  [[nodiscard]] static bool write(std::uint8_t address, std::span<const std::byte> head,
                                  std::span<const std::byte> bytes = {}) noexcept;
  /// Start, write `head`, start again, read out.size() bytes, stop.
  [[nodiscard]] static bool read(std::uint8_t address, std::span<const std::byte> head,
                                 std::span<std::byte> out) noexcept;
  /// Frees a bus on which a part was cut off in the middle of a byte: nine clocks and a stop.
  static void recover() noexcept;
};

}  // namespace scatter::firmware::mps2_an500
