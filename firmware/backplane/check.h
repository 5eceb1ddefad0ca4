// The last byte of a message between board and bench.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace scatter::firmware::backplane {

/// 0xFF - (sum of the bytes before it) mod 256.
[[nodiscard]] constexpr std::byte check_of(std::span<const std::byte> bytes) noexcept {
  std::uint32_t sum = 0;
  for (const std::byte byte : bytes) {
    sum += static_cast<std::uint32_t>(byte);
  }
  return static_cast<std::byte>(0xFFU - (sum & 0xFFU));
}

}  // namespace scatter::firmware::backplane
