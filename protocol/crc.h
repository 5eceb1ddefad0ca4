// CRC-32C (Castagnoli): the checksum of headers, payloads, objects, frames and records.
//
// Polynomial 0x1EDC6F41, reflected, initial value and final XOR 0xFFFFFFFF (RFC 3720 appendix B.4;
// check value of "123456789" is 0xE3069283). It detects every error of up to 5 bits in up to 655
// bytes and every error of up to 3 bits in up to 2^31 - 1 bits.
#pragma once

#include <array>
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

/// CRCs of pieces put together without their bytes: appending n bytes multiplies the CRC so far by x^(8n)
/// modulo the polynomial (M. Adler's crc32_combine in zlib; for this CRC initial value and final XOR cancel).
/// Made once per length of the second piece. Thread-safe.
class Crc32cConcat {
 public:
  /// Cost: about log2(second_bytes) products of 32 steps each.
  explicit Crc32cConcat(std::size_t second_bytes = 0) noexcept;
  [[nodiscard]] std::size_t second_bytes() const noexcept { return second_bytes_; }

  /// The CRC of a followed by b, from those of a and of b. Exclusive or undoes itself: from those of a and of
  /// a followed by b it is the CRC of b. Cost: one product, 32 steps.
  [[nodiscard]] std::uint32_t operator()(std::uint32_t first, std::uint32_t second) const noexcept;

 private:
  std::size_t second_bytes_ = 0;
  std::uint32_t factor_ =
      0x80000000U;  ///< x^(8 second_bytes) modulo the polynomial, reflected: bit 31 is x^0.
};

/// The CRC of what a row of messages carries in their tails, from the checksums that prove their payloads: no
/// tail is looked at again. Not thread-safe.
class TailCrc {
 public:
  /// `crc` continued by the last `tail_bytes` of `payload`, whose CRC is `payload_crc`. Cost: the CRC of the
  /// bytes before the tail and two products; a Crc32cConcat more when tail_bytes is neither of the last two.
  [[nodiscard]] std::uint32_t append(std::uint32_t crc, std::span<const std::byte> payload,
                                     std::uint32_t payload_crc, std::size_t tail_bytes) noexcept;

 private:
  // The last used one and the one before: a row, or a frame, ends with a shorter message than its others.
  std::array<Crc32cConcat, 2> concats_;
};

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
