// Bytes on their way to the host. Control and event frames overtake stream frames at frame boundaries;
// a frame once begun is finished, however little the carrier takes at a time.
//
// RAM: kControlBytes + kMaxControlFrame; the stream frame is the caller's. Not thread-safe. No call blocks.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <type_traits>

#include "firmware/ports/ports.h"
#include "protocol/frame.h"

namespace scatter::firmware {

class LinkOutput {
 public:
  /// Queue for control and event frames, length words included.
  static constexpr std::size_t kControlBytes = 12 * 1024;
  /// Largest control or event frame.
  static constexpr std::size_t kMaxControlFrame = 4608;

  /// `stream` holds one stream frame of the carrier's longest payload and outlives this; empty where nothing
  /// is streamed.
  explicit LinkOutput(Link& link, std::span<std::byte> stream = {}) noexcept : link_(link), stream_(stream) {}

  /// The carrier closed: everything waiting is gone, a frame under way included.
  void clear() noexcept;
  /// A new session: waiting frames of the old one are dropped, a frame under way is finished so that
  /// the host's decoder stays in step; sequence numbers start again at 0.
  void begin_session(std::uint16_t session) noexcept;
  [[nodiscard]] std::uint16_t session() const noexcept { return session_; }

  /// True when a reply of any allowed size fits now, and a few events beside it.
  [[nodiscard]] bool has_control_room() const noexcept {
    return kControlBytes - used_ >= kMaxControlFrame + kEventReserve;
  }

  /// Queues a message; the bytes queued (valid until the next send), empty when there is no room.
  template <protocol::Message M>
  std::span<const std::byte> send(protocol::Channel channel, const M& message, std::uint16_t session,
                                  std::uint16_t correlation) noexcept {
    protocol::FrameHeader header;
    header.channel = channel;
    header.session = session;
    header.correlation = correlation;
    std::uint32_t& next = sequence_[static_cast<std::size_t>(channel)];
    // The bytes of this refusal never change, whatever was said before it (SPEC 6.4).
    const bool numbered = !refuses_wire_version(message);
    header.sequence = numbered ? next : 0;
    const std::size_t size = protocol::write_message(scratch_, header, message);
    if (size == 0 || !queue({scratch_.data(), size})) {
      return {};
    }
    next += numbered ? 1 : 0;
    return {scratch_.data(), size};
  }
  /// Queues a whole frame again (a repeated reply). False = no room.
  bool queue(std::span<const std::byte> frame) noexcept;

  /// Buffer for the next stream frame; empty while the last one waits.
  [[nodiscard]] std::span<std::byte> stream_slot() noexcept;
  /// Header for the frame in the slot; takes the next sequence number.
  [[nodiscard]] protocol::FrameHeader stream_header() noexcept;
  /// The slot now holds `size` bytes of a whole frame.
  void submit_stream(std::size_t size) noexcept;
  /// True when every submitted stream byte was taken by the carrier.
  [[nodiscard]] bool stream_idle() const noexcept { return stream_size_ == 0; }
  /// Drops the submitted frame if none of its bytes was taken yet; true when one was dropped.
  bool discard_stream() noexcept;

  /// Hands bytes to the carrier; true when it took any.
  bool pump() noexcept;
  /// Nothing waits.
  [[nodiscard]] bool idle() const noexcept { return used_ == 0 && stream_size_ == 0; }

 private:
  static constexpr std::size_t kLengthBytes = 2;
  static constexpr std::size_t kEventReserve = 1024;
  enum class Writing : std::uint8_t { kNothing, kControl, kStream };

  template <protocol::Message M>
  [[nodiscard]] static constexpr bool refuses_wire_version(const M& message) noexcept {
    if constexpr (std::is_same_v<M, protocol::StatusReply>) {
      return message.status == protocol::StatusCode::kVersionMismatch &&
             message.request == static_cast<std::uint16_t>(protocol::MessageId::kHello);
    } else {
      return false;
    }
  }
  void push(std::span<const std::byte> bytes) noexcept;
  [[nodiscard]] std::size_t peek_length() const noexcept;
  std::size_t write_control() noexcept;
  std::size_t write_stream() noexcept;
  void drop(std::size_t count) noexcept;

  Link& link_;
  std::array<std::byte, kControlBytes> ring_{};
  std::size_t first_ = 0;
  std::size_t used_ = 0;
  std::size_t control_left_ = 0;  // Bytes of the control frame under way.
  std::span<std::byte> stream_;
  std::size_t stream_size_ = 0;
  std::size_t stream_sent_ = 0;
  std::array<std::byte, kMaxControlFrame> scratch_{};
  Writing writing_ = Writing::kNothing;
  std::uint16_t session_ = 0;
  std::array<std::uint32_t, protocol::kChannels> sequence_{};
};

}  // namespace scatter::firmware
