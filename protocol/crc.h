// CRC-32C (Castagnoli): the checksum of headers, payloads, objects, frames and records.
//
// Polynomial 0x1EDC6F41, reflected, initial value and final XOR 0xFFFFFFFF (RFC 3720 appendix B.4;
// check value of "123456789" is 0xE3069283). It detects every error of up to 5 bits in up to 655
// bytes and every error of up to 3 bits in up to 2^31 - 1 bits.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace scatter::protocol {

/// CRC-32C of `bytes`. `seed` is the CRC of the bytes before them, so that
/// crc32c(b, crc32c(a)) == crc32c(a followed by b). Picks the processor's instruction when it has one.
/// Thread-safe; no allocation. Cost: about 8 bytes per cycle with the instruction (x86: SSE4.2 with
/// PCLMULQDQ), 1 to 2 bytes per cycle with tables (8 KiB; 1 KiB on Cortex-M).
[[nodiscard]] std::uint32_t crc32c(std::span<const std::byte> bytes, std::uint32_t seed = 0) noexcept;

/// The same by table on any processor.
[[nodiscard]] std::uint32_t crc32c_table(std::span<const std::byte> bytes, std::uint32_t seed = 0) noexcept;

/// True when this processor has the instruction that crc32c_hardware uses.
[[nodiscard]] bool crc32c_have_hardware() noexcept;

/// The same by instruction. Falls back to the table where crc32c_have_hardware() is false.
[[nodiscard]] std::uint32_t crc32c_hardware(std::span<const std::byte> bytes,
                                            std::uint32_t seed = 0) noexcept;

/// One byte at a time without a table: for constants computed while compiling.
[[nodiscard]] constexpr std::uint32_t crc32c_bitwise(std::span<const std::byte> bytes,
                                                     std::uint32_t seed = 0) noexcept {
  std::uint32_t crc = ~seed;
  for (const std::byte b : bytes) {
    crc ^= static_cast<std::uint32_t>(b);
    for (int bit = 0; bit < 8; ++bit) {
      crc = (crc >> 1U) ^ ((crc & 1U) != 0 ? 0x82F63B78U : 0U);
    }
  }
  return ~crc;
}

}  // namespace scatter::protocol
