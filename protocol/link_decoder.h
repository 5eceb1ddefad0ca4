// Frames out of a byte pipe that may hold garbage, cut or damaged frames (SPEC.md section 2).
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "protocol/frame.h"

namespace scatter::protocol {

/// What a decoder has seen; each counter names what was lost. All wrap at 2^32.
struct LinkCounters {
  std::uint32_t good = 0;             ///< Frames delivered.
  std::uint32_t bad_header = 0;       ///< Magic found, header checksum wrong.
  std::uint32_t bad_length = 0;       ///< Header intact, payload over the limit.
  std::uint32_t bad_payload = 0;      ///< Header intact, payload checksum wrong or never arrived.
  std::uint32_t bad_version = 0;      ///< Intact, other wire major.
  std::uint32_t unknown_flags = 0;    ///< Intact, unknown incompatible flag.
  std::uint32_t unknown_channel = 0;  ///< Intact, channel that does not exist.
  std::uint32_t skipped_bytes = 0;    ///< Bytes that were part of no intact frame.

  /// Adds the result of one parse; `skipped_bytes` grows for everything but frames.
  void count(const ParseResult& result) noexcept;
  friend constexpr bool operator==(const LinkCounters&, const LinkCounters&) noexcept = default;
};

/// Decoder for sockets, USB bulk and recordings. Promises:
/// - it delivers nothing that is not a whole intact frame;
/// - any way of cutting the bytes into pieces gives the same frames and counters;
/// - after garbage the next whole frame is delivered, even when it lies inside the bytes that a
///   damaged frame claimed. That damaged frame can hold it back until the claimed bytes have come;
///   give_up() ends such a wait.
///
/// Frames are views: of the pushed bytes where a frame lies whole in them (no copy), else of the
/// decoder's buffer. They are valid until the callback returns. Not thread-safe; callbacks must not
/// call the decoder.
class LinkDecoder {
 public:
  /// `buffer` must outlive the decoder. Payloads up to min(max_payload, buffer.size() - kFrameOverhead)
  /// are accepted; kMaxFrameBytes is enough for all.
  explicit LinkDecoder(std::span<std::byte> buffer, std::uint32_t max_payload = kMaxPayload) noexcept;

  /// Takes all of `bytes`; calls on_frame(const Frame&) for each frame in order and
  /// on_refused(const FrameHeader&, ParseStatus) for each intact frame of a kind not understood.
  template <typename OnFrame, typename OnRefused>
  void push(std::span<const std::byte> bytes, OnFrame&& on_frame, OnRefused&& on_refused) {
    for (ParseResult result = next(bytes); result.status != ParseStatus::kNeedMore; result = next(bytes)) {
      if (result.frame) {
        on_frame(*result.frame);
      } else {
        on_refused(result.header, result.status);
      }
    }
  }
  template <typename OnFrame>
  void push(std::span<const std::byte> bytes, OnFrame&& on_frame) {
    push(bytes, on_frame, [](const FrameHeader&, ParseStatus) {});
  }

  /// The pull form: takes bytes off the front of `bytes` up to the next frame or refused frame and
  /// returns it; kNeedMore when `bytes` is used up. The frame is valid until the next call.
  [[nodiscard]] ParseResult next(std::span<const std::byte>& bytes) noexcept;

  /// Call when the peer has been silent for longer than a frame takes: the frame under way is broken.
  /// Counts it, then delivers whole frames among the bytes it had claimed.
  template <typename OnFrame>
  void give_up(OnFrame&& on_frame) {
    while (begin_ != end_) {
      abandon_first_byte();
      push({}, on_frame);
    }
  }

  /// Forgets buffered bytes (link closed or opened anew); counters stay.
  void reset() noexcept { begin_ = end_ = 0; }
  /// Bytes of an unfinished frame now held.
  [[nodiscard]] std::size_t buffered() const noexcept { return end_ - begin_; }
  [[nodiscard]] const LinkCounters& counters() const noexcept { return counters_; }
  /// Changes the limit (after HELLO); bounded by the buffer.
  void set_max_payload(std::uint32_t max_payload) noexcept;

 private:
  void keep(std::span<const std::byte> bytes) noexcept;
  void abandon_first_byte() noexcept;

  std::span<std::byte> buffer_;
  std::size_t begin_ = 0;
  std::size_t end_ = 0;
  std::uint32_t max_payload_ = 0;
  LinkCounters counters_;
};

}  // namespace scatter::protocol
