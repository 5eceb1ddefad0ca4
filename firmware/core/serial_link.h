// A byte line (UART) as the Link that the core wants: whole frames in and out, with serial framing on the
// line (protocol/serial.h). What the line loses or damages costs the frames it hits; the core never sees a
// part.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "firmware/ports/ports.h"
#include "protocol/serial.h"

namespace scatter::firmware {

/// `line` carries raw bytes and must outlive this. RAM: about 3.8 KiB. One thread; no call blocks.
class SerialLink final : public Link {
 public:
  constexpr explicit SerialLink(Link& line) noexcept : line_(line) {}

  /// Bytes of whole intact frames, and of intact frames that this version refuses; a frame may come in pieces
  /// when `out` is short.
  [[nodiscard]] std::size_t read(std::span<std::byte> out) noexcept override;
  /// Takes frames as a stream of bytes, cut anywhere. Bytes that are no frame are discarded up to the next
  /// one.
  [[nodiscard]] std::size_t write(std::span<const std::byte> bytes) noexcept override;
  [[nodiscard]] bool connected() noexcept override { return line_.connected(); }
  [[nodiscard]] std::uint32_t max_payload() noexcept override { return protocol::kMaxSerialPayload; }

  /// Hands the line what it has room for. Call it once per turn of the main loop.
  void pump() noexcept;
  /// Nothing waits here (the line may still hold bytes).
  [[nodiscard]] bool idle() const noexcept { return sent_ == encoded_size_ && frame_size_ == 0; }
  /// What arrived damaged: each counter names what was lost.
  [[nodiscard]] const protocol::LinkCounters& counters() const noexcept { return decoder_.counters(); }
  [[nodiscard]] const protocol::LinkCounters* dropped() noexcept override { return &decoder_.counters(); }
  /// Frames that were longer than the line carries, and bytes between frames; 0 unless the core is wrong.
  [[nodiscard]] std::uint32_t unsendable() const noexcept { return unsendable_; }

 private:
  static constexpr std::size_t kFrameBytes = protocol::kFrameOverhead + protocol::kMaxSerialPayload;
  static constexpr std::size_t kRawBytes = 128;

  bool fetch() noexcept;
  void send_encoded() noexcept;
  void take(std::span<const std::byte>& bytes) noexcept;
  void skip_to_next_beginning() noexcept;
  [[nodiscard]] std::size_t announced_size() const noexcept;
  [[nodiscard]] bool frame_is_whole() const noexcept {
    return frame_size_ >= protocol::kHeaderBytes && frame_size_ == announced_size();
  }

  Link& line_;
  std::array<std::byte, kFrameBytes> received_{};  // Block under way, then the frame that read() hands out.
  protocol::SerialDecoder decoder_{received_};
  std::array<std::byte, kRawBytes> raw_{};
  std::span<const std::byte> undecoded_;  // Of raw_.
  std::span<const std::byte> unread_;     // Of received_.

  std::array<std::byte, kFrameBytes> frame_{};  // To be sent, collected until it is whole.
  std::size_t frame_size_ = 0;
  std::array<std::byte, protocol::serial_max_size(protocol::kMaxSerialPayload)> encoded_{};
  std::size_t encoded_size_ = 0;
  std::size_t sent_ = 0;
  std::uint32_t unsendable_ = 0;
};

}  // namespace scatter::firmware
