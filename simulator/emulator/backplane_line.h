// Messages of firmware/backplane on a stream of bytes: kind, length, payload, check.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "firmware/backplane/check.h"
#include "firmware/backplane/messages.h"
#include "protocol/codec.h"

namespace scatter::simulator {

/// Adds a message to `line`.
template <protocol::Message M>
void put_message(std::vector<std::byte>& line, const M& message) {
  std::array<std::byte, 3 + firmware::backplane::kMaxPayload> bytes{};
  static_assert(protocol::max_encoded_size<M>() <= firmware::backplane::kMaxPayload);
  const std::size_t size =
      *protocol::encode(message, std::span(bytes).subspan(2, firmware::backplane::kMaxPayload));
  bytes[0] = static_cast<std::byte>(M::kKind);
  bytes[1] = static_cast<std::byte>(size);
  bytes[2 + size] = firmware::backplane::check_of(std::span(bytes).first(2 + size));
  line.insert(line.end(), bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(3 + size));
}

/// Finds messages in a stream of bytes. Threads: one. Memory: one message.
class BackplaneDecoder {
 public:
  struct Message {
    std::uint8_t kind = 0;
    std::span<const std::byte> payload;  ///< Until the callback returns.
    bool intact = false;                 ///< Length and check are right.
  };

  /// Calls on_message(const Message&) for each message, damaged ones included. A wrong length ends at that
  /// byte; what follows is taken for the next message.
  template <typename OnMessage>
  void push(std::span<const std::byte> bytes, OnMessage&& on_message) {
    for (const std::byte b : bytes) {
      bytes_[held_++] = b;
      const std::size_t length = held_ > 1 ? std::to_integer<std::size_t>(bytes_[1]) : 0;
      if (length > firmware::backplane::kMaxPayload) {
        held_ = 0;
        on_message(Message{.kind = std::to_integer<std::uint8_t>(bytes_[0]), .payload = {}, .intact = false});
      } else if (held_ == 3 + length && held_ > 2) {
        held_ = 0;
        const auto whole = std::span<const std::byte>(bytes_).first(2 + length);
        on_message(Message{.kind = std::to_integer<std::uint8_t>(bytes_[0]),
                           .payload = whole.subspan(2),
                           .intact = firmware::backplane::check_of(whole) == b});
      }
    }
  }
  void reset() noexcept { held_ = 0; }

 private:
  std::array<std::byte, 3 + firmware::backplane::kMaxPayload> bytes_{};
  std::size_t held_ = 0;
};

}  // namespace scatter::simulator
