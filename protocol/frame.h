// Wire frames: header, checksums, one-frame parser and builder (SPEC.md section 1).
//
//   offset size field
//        0    2 magic 0x5CA7 (bytes A7 5C)
//        2    1 wire major
//        3    1 channel: 0 control, 1 event, 2 stream, 3 transfer
//        4    1 incompatible flags (unknown bit: drop, count, error reply)
//        5    1 compatible flags (unknown bit: ignore)
//        6    2 message id
//        8    4 payload length, bytes
//       12    4 sequence, per channel and direction
//       16    2 session nonce
//       18    2 correlation, 0 = none
//       20    4 CRC-32C of bytes 0..19
//       24    n payload
//     24+n    4 CRC-32C of the payload
// All little endian. This layout is the same in every wire major.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "protocol/codec.h"
#include "protocol/endian.h"
#include "protocol/messages.h"

namespace scatter::protocol {

enum class Channel : std::uint8_t { kControl = 0, kEvent = 1, kStream = 2, kTransfer = 3 };

inline constexpr std::size_t kChannels = 4;
inline constexpr std::size_t kHeaderBytes = 24;
inline constexpr std::size_t kTrailerBytes = 4;
inline constexpr std::size_t kFrameOverhead = kHeaderBytes + kTrailerBytes;
inline constexpr std::uint32_t kMaxPayload = 16 * 1024;
inline constexpr std::uint32_t kMaxSerialPayload = 1024;
inline constexpr std::size_t kMaxFrameBytes = kHeaderBytes + kMaxPayload + kTrailerBytes;
inline constexpr std::uint16_t kMagic = 0x5CA7;
/// Incompatible flag bits that this version knows: none yet.
inline constexpr std::uint8_t kKnownIncompatibleFlags = 0;

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

  /// The message id as its enum; may hold a number that MessageId does not name.
  [[nodiscard]] constexpr MessageId id() const noexcept { return static_cast<MessageId>(message); }
  friend constexpr bool operator==(const FrameHeader&, const FrameHeader&) noexcept = default;
};

/// A whole, checked frame: views into the caller's buffer. Made by parse_frame only, so a Frame in
/// hand is proof that header and payload are intact.
class Frame {
 public:
  [[nodiscard]] const FrameHeader& header() const noexcept { return header_; }
  [[nodiscard]] MessageId id() const noexcept { return header_.id(); }
  [[nodiscard]] std::span<const std::byte> payload() const noexcept {
    return bytes_.subspan(kHeaderBytes, header_.payload_length);
  }
  /// The CRC-32C of payload().
  [[nodiscard]] std::uint32_t payload_crc() const noexcept {
    return load_le<std::uint32_t>(bytes_.data() + kHeaderBytes + header_.payload_length);
  }
  /// Header, payload and trailer as they came.
  [[nodiscard]] std::span<const std::byte> bytes() const noexcept { return bytes_; }

  /// The payload as message M; nullopt when the id is another or the payload is no such message.
  /// A tail is a view into bytes().
  template <Message M>
  [[nodiscard]] std::optional<M> as() const noexcept {
    return id() == M::kId ? decode<M>(payload()) : std::nullopt;
  }

 private:
  friend struct ParseAccess;
  Frame() = default;
  FrameHeader header_;
  std::span<const std::byte> bytes_;
};

enum class ParseStatus : std::uint8_t {
  kFrame,           ///< `frame` holds a frame.
  kNeedMore,        ///< The bytes so far are the start of a frame; at least `missing` more are needed.
  kNoMagic,         ///< No frame starts here.
  kBadHeader,       ///< Magic found, header checksum wrong.
  kBadLength,       ///< Header intact, payload longer than the limit.
  kBadPayload,      ///< Header intact, payload checksum wrong.
  kBadVersion,      ///< Whole and intact, of another wire major: refused.
  kUnknownFlags,    ///< Whole and intact, with an unknown incompatible flag: refused.
  kUnknownChannel,  ///< Whole and intact, on a channel that does not exist: refused.
};

/// True for frames that arrived intact but that this version does not understand: the receiver counts
/// them and, when they carry a correlation on the control channel, answers VERSION_MISMATCH.
[[nodiscard]] constexpr bool is_refused(ParseStatus status) noexcept {
  return status == ParseStatus::kBadVersion || status == ParseStatus::kUnknownFlags ||
         status == ParseStatus::kUnknownChannel;
}

struct ParseResult {
  ParseStatus status = ParseStatus::kNeedMore;
  /// Bytes that are done with: the whole frame for kFrame and refused frames; otherwise what cannot be
  /// the start of a frame, so that parsing goes on behind it (at least 1; 0 for kNeedMore).
  std::size_t consumed = 0;
  std::size_t missing = 0;     ///< kNeedMore only.
  FrameHeader header{};        ///< Valid when the header checksum was right.
  std::optional<Frame> frame;  ///< kFrame only; views into the bytes given.
};

/// Looks at the start of `bytes` for one frame with a payload of at most `max_payload` bytes.
/// No copy; cost: one CRC-32C over the frame. Thread-safe.
[[nodiscard]] ParseResult parse_frame(std::span<const std::byte> bytes,
                                      std::uint32_t max_payload = kMaxPayload) noexcept;

/// Writes a whole frame at the start of `out`; its size, or 0 when `out` is too small or the payload is
/// over kMaxPayload. `header.payload_length` is ignored. `payload` may lie in `out` at kHeaderBytes.
[[nodiscard]] std::size_t write_frame(std::span<std::byte> out, const FrameHeader& header,
                                      std::span<const std::byte> payload) noexcept;

/// Puts header and checksums around `payload_length` bytes that already lie at out[kHeaderBytes].
[[nodiscard]] std::size_t finish_frame(std::span<std::byte> out, const FrameHeader& header,
                                       std::size_t payload_length) noexcept;

/// Writes `message` as a frame, encoded straight into place; its size, or 0 when it does not fit.
/// `header.message` and `header.payload_length` are ignored. A tail produced in place lies at
/// out[kHeaderBytes + min_encoded_size<M>()] and is not copied.
template <Message M>
[[nodiscard]] std::size_t write_message(std::span<std::byte> out, FrameHeader header,
                                        const M& message) noexcept {
  if (out.size() < kFrameOverhead) {
    return 0;
  }
  const auto size = encode(message, out.subspan(kHeaderBytes, out.size() - kFrameOverhead));
  if (!size) {
    return 0;
  }
  header.message = static_cast<std::uint16_t>(M::kId);
  return finish_frame(out, header, *size);
}

}  // namespace scatter::protocol
