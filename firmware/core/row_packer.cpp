#include "firmware/core/row_packer.h"

#include <algorithm>
#include <bit>
#include <cstring>

namespace scatter::firmware {

void RowPacker::begin(protocol::PixelFormat format) noexcept {
  format_ = format;
  carry_ = 0;
  carry_bits_ = 0;
}

std::uint32_t RowPacker::pixels_that_fit(std::uint32_t capacity) const noexcept {
  const std::uint64_t bits = std::uint64_t{capacity} * 8;
  return bits <= carry_bits_ ? 0 : static_cast<std::uint32_t>((bits - carry_bits_) / packed_bits(format_));
}

std::size_t RowPacker::pack(std::span<const std::uint16_t> pixels, std::span<std::byte> out) noexcept {
  if (format_ == protocol::PixelFormat::kMono16 && std::endian::native == std::endian::little) {
    std::memcpy(out.data(), pixels.data(), pixels.size_bytes());
    return pixels.size_bytes();
  }
  const std::uint32_t bits = packed_bits(format_);
  const std::uint32_t ceiling = (1U << bits) - 1U;
  std::size_t written = 0;
  for (const std::uint16_t pixel : pixels) {
    carry_ |= std::min<std::uint32_t>(pixel, ceiling) << carry_bits_;
    carry_bits_ += bits;
    while (carry_bits_ >= 8) {
      out[written++] = static_cast<std::byte>(carry_ & 0xFFU);
      carry_ >>= 8U;
      carry_bits_ -= 8;
    }
  }
  return written;
}

std::size_t RowPacker::finish(std::span<std::byte> out) noexcept {
  if (carry_bits_ == 0) {
    return 0;
  }
  out[0] = static_cast<std::byte>(carry_ & 0xFFU);
  carry_ = 0;
  carry_bits_ = 0;
  return 1;
}

}  // namespace scatter::firmware
