// Consistent Overhead Byte Stuffing (Cheshire and Baker 1999): bytes without zeros, so that a zero can
// mark the end of a frame on serial lines that lose bytes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace scatter::protocol {

/// Most bytes that cobs_encode makes of `size` bytes.
[[nodiscard]] constexpr std::size_t cobs_max_size(std::size_t size) noexcept {
  return size + size / 254 + 1;
}

/// Encodes `bytes` without a closing zero. Size written, or 0 when `out` is smaller than the result
/// needs. `out` must not overlap `bytes`. Cost O(size); thread-safe.
[[nodiscard]] std::size_t cobs_encode(std::span<const std::byte> bytes, std::span<std::byte> out) noexcept;

/// COBS decoder for bytes that come in pieces; a zero ends a block. RAM: the caller's buffer and three
/// words. Not thread-safe.
class CobsDecoder {
 public:
  enum class Event : std::uint8_t {
    kNeedMore,   ///< `bytes` is used up inside a block or between blocks.
    kBlock,      ///< A whole block is in block().
    kMalformed,  ///< A zero came inside a group: the block lost or gained bytes, and is dropped.
    kTooLong,    ///< The block was longer than the buffer, and is dropped.
  };

  /// `buffer` must outlive the decoder and bounds a decoded block.
  constexpr explicit CobsDecoder(std::span<std::byte> buffer) noexcept : buffer_(buffer) {}

  /// Takes bytes off the front of `bytes` up to the next closing zero. Empty blocks (zeros in a row)
  /// are skipped: a zero before a frame ends what noise on an idle line began.
  [[nodiscard]] Event next(std::span<const std::byte>& bytes) noexcept;

  /// The block of the last kBlock; valid until the next call of next().
  [[nodiscard]] std::span<const std::byte> block() const noexcept { return buffer_.first(size_); }
  /// Encoded bytes of the last kBlock, kMalformed or kTooLong, without the zero.
  [[nodiscard]] std::size_t encoded_size() const noexcept { return encoded_; }
  /// Forgets a block under way.
  void reset() noexcept { *this = CobsDecoder(buffer_); }

 private:
  std::span<std::byte> buffer_;
  std::size_t size_ = 0;     ///< Decoded bytes of the block under way.
  std::size_t encoded_ = 0;  ///< Its encoded bytes.
  std::uint8_t left_ = 0;    ///< Bytes until the next code byte.
  bool zero_due_ = false;    ///< A zero stands before the next group, if there is one.
  bool overflow_ = false;
  bool ended_ = true;  ///< The next byte begins a block.
};

}  // namespace scatter::protocol
