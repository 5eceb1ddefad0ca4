// One exposure as it reached the host: metadata, pixels, and whether it is whole.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include "host_sdk/error/error.h"
#include "protocol/messages.h"

namespace scatter::device {

enum class FrameStatus : std::uint8_t {
  kComplete,    ///< Begin, every byte and end arrived; checksum and metadata agree.
  kIncomplete,  ///< Something is missing: see Frame::missing, has_begin, has_end.
  kCorrupt,     ///< Everything arrived, but the checksum over the pixels or the metadata disagree.
};

[[nodiscard]] std::string_view name(FrameStatus status) noexcept;

/// Half-open range of pixel bytes [begin, end).
struct ByteRange {
  std::uint32_t begin = 0;
  std::uint32_t end = 0;
  friend bool operator==(const ByteRange&, const ByteRange&) noexcept = default;
};

/// Copies share the pixels (reference counted, returned to their pool with the last copy), which
/// nobody writes after delivery: hand copies to other threads freely.
/// A missing byte is never patched: its place holds zero and `missing` names it.
struct Frame {
  protocol::FrameBegin begin;  ///< Defaults except run and frame id when !has_begin.
  protocol::FrameEnd end;      ///< Defaults except run and frame id when !has_end.
  bool has_begin = false;
  bool has_end = false;
  FrameStatus status = FrameStatus::kIncomplete;
  std::vector<ByteRange> missing;       ///< Ascending; empty unless kIncomplete.
  std::uint64_t host_time_unix_ns = 0;  ///< When the last part arrived, on the transport's clock.
  std::shared_ptr<const std::byte[]> pixels;
  std::uint32_t size_bytes = 0;

  /// Packed pixels as `begin.pixel_format` says, row after row of the window. 8-byte aligned.
  [[nodiscard]] std::span<const std::byte> bytes() const noexcept { return {pixels.get(), size_bytes}; }
  [[nodiscard]] std::size_t pixel_count() const noexcept {
    return static_cast<std::size_t>(begin.width) * begin.height;
  }
};

/// Bytes of `pixel_count` pixels: 2 per pixel for Mono16, 10 or 12 bits per pixel, rounded up to a
/// whole byte at the end of the frame, for the packed formats. 0 for an unknown format.
[[nodiscard]] std::uint64_t packed_bytes(protocol::PixelFormat format, std::uint64_t pixel_count) noexcept;

/// Pixels as u16 [DN], whatever their packing.
/// Shape   out.size() == frame.pixel_count().
/// Errors  kFailedPrecondition: the frame is not kComplete; kInvalidArgument: shape or format.
/// Cost    no allocation, one pass; thread-safe.
[[nodiscard]] Status unpack(const Frame& frame, std::span<std::uint16_t> out);

/// Packed little endian, least significant bit first (PFNC Mono10p: 4 pixels in 5 bytes, Mono12p:
/// 2 pixels in 3 bytes). Precondition: packed.size() == packed_bytes(format, out.size()).
void unpack_mono10p(std::span<const std::byte> packed, std::span<std::uint16_t> out) noexcept;
void unpack_mono12p(std::span<const std::byte> packed, std::span<std::uint16_t> out) noexcept;

}  // namespace scatter::device
