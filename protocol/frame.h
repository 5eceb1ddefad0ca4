// Wire frames: header, checksums, one-frame parser and builder (SPEC.md section 1).
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "protocol/messages.h"

namespace scatter::protocol {

enum class Channel : std::uint8_t { kControl = 0, kEvent = 1, kStream = 2, kTransfer = 3 };

inline constexpr std::size_t kHeaderBytes = 24;
inline constexpr std::size_t kTrailerBytes = 4;
inline constexpr std::uint32_t kMaxPayload = 16 * 1024;
inline constexpr std::uint32_t kMaxSerialPayload = 1024;
inline constexpr std::size_t kMaxFrameBytes = kHeaderBytes + kMaxPayload + kTrailerBytes;
inline constexpr std::uint16_t kMagic = 0x5CA7;

struct FrameHeader {
  std::uint8_t wire_major = kWireMajor;
  Channel channel = Channel::kControl;
  std::uint8_t incompatible_flags = 0;
  std::uint8_t compatible_flags = 0;
  std::uint16_t message = 0;         ///< MessageId; unknown numbers are possible.
  std::uint32_t payload_length = 0;  ///< Set by write_frame.
  std::uint32_t sequence = 0;        ///< Per channel and direction.
  std::uint16_t session = 0;         ///< Nonce chosen by the host in HELLO.
  std::uint16_t correlation = 0;     ///< Request id, 0 = none.
};

/// A whole, checked frame: views into the caller's buffer. Made by parse_frame only, so a Frame in
/// hand is proof that header and payload are intact.
class Frame {
 public:
  [[nodiscard]] const FrameHeader& header() const noexcept { return header_; }
  [[nodiscard]] std::span<const std::byte> payload() const noexcept {
    return bytes_.subspan(kHeaderBytes, header_.payload_length);
  }
  /// Header, payload and trailer as they came.
  [[nodiscard]] std::span<const std::byte> bytes() const noexcept { return bytes_; }

 private:
  friend struct ParseAccess;
  Frame() = default;
  FrameHeader header_;
  std::span<const std::byte> bytes_;
};

}  // namespace scatter::protocol
