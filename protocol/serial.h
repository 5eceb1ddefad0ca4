// Frames on serial lines: COBS(frame) and a closing zero (SPEC.md section 3).
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "protocol/cobs.h"
#include "protocol/frame.h"
#include "protocol/link_decoder.h"

namespace scatter::protocol {

/// Most bytes of one frame with `payload` bytes of payload on a serial line.
[[nodiscard]] constexpr std::size_t serial_max_size(std::size_t payload) noexcept {
  return 1 + cobs_max_size(kFrameOverhead + payload) + 1;
}

/// Writes a frame (as made by write_frame) for a serial line; its size, or 0 when `out` is too small.
/// `after_idle` puts a zero before it, which ends whatever noise the receiver took for a beginning;
/// use it for the first frame and after each pause.
[[nodiscard]] std::size_t write_serial(std::span<std::byte> out, std::span<const std::byte> frame,
                                       bool after_idle) noexcept;

/// Decoder for serial lines; same promises as LinkDecoder. A damaged block costs itself only, or
/// itself and its neighbour when the zero between them was lost; the next zero resynchronises.
class SerialDecoder {
 public:
  /// `buffer` must outlive the decoder and hold a whole frame (kFrameOverhead + max_payload).
  constexpr explicit SerialDecoder(std::span<std::byte> buffer,
                                   std::uint32_t max_payload = kMaxSerialPayload) noexcept
      : cobs_(buffer), max_payload_(max_payload) {}

  /// As LinkDecoder::push.
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

  /// As LinkDecoder::next.
  [[nodiscard]] ParseResult next(std::span<const std::byte>& bytes) noexcept;

  /// Bytes of the frame or refused frame that next() gave last, valid until its next call.
  [[nodiscard]] std::span<const std::byte> block() const noexcept { return cobs_.block(); }

  void reset() noexcept { cobs_.reset(); }
  /// A block that is no frame counts once: as bad_length when too long or when a whole frame does not
  /// fill it, as bad_payload or bad_header by its checksums, as bad_header when it is no COBS at all.
  [[nodiscard]] const LinkCounters& counters() const noexcept { return counters_; }

 private:
  CobsDecoder cobs_;
  std::uint32_t max_payload_;
  LinkCounters counters_;
};

}  // namespace scatter::protocol
