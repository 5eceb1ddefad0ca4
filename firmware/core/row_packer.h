// Pixels to wire bytes, a band at a time: Mono16 little endian, Mono10p and Mono12p (PFNC: pixels
// packed LSB first without gaps, rows not padded, the last byte filled with zero bits).
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "protocol/types.h"

namespace scatter::firmware {

/// Bits that one pixel takes on the wire; 0 for an unknown format.
[[nodiscard]] constexpr std::uint32_t packed_bits(protocol::PixelFormat format) noexcept {
  switch (format) {
    case protocol::PixelFormat::kMono16:
      return 16;
    case protocol::PixelFormat::kMono10p:
      return 10;
    case protocol::PixelFormat::kMono12p:
      return 12;
  }
  return 0;
}

/// Bytes of a whole frame of `pixels` pixels.
[[nodiscard]] constexpr std::uint64_t packed_bytes(protocol::PixelFormat format,
                                                   std::uint64_t pixels) noexcept {
  return (pixels * packed_bits(format) + 7) / 8;
}

class RowPacker {
 public:
  /// Starts a frame; bits left over from the last one are forgotten.
  void begin(protocol::PixelFormat format) noexcept;

  /// Most pixels that pack() can take without overrunning `capacity` bytes.
  [[nodiscard]] std::uint32_t pixels_that_fit(std::uint32_t capacity) const noexcept;

  /// Appends pixels; returns the bytes written. Pixels above the format's range are clipped to it.
  /// `out` must have room as told by pixels_that_fit.
  std::size_t pack(std::span<const std::uint16_t> pixels, std::span<std::byte> out) noexcept;

  /// Writes the last, partly filled byte: 0 or 1 bytes.
  std::size_t finish(std::span<std::byte> out) noexcept;

 private:
  protocol::PixelFormat format_ = protocol::PixelFormat::kMono16;
  std::uint32_t carry_ = 0;       // Bits not yet written, in the low end.
  std::uint32_t carry_bits_ = 0;  // 0..7
};

}  // namespace scatter::firmware
