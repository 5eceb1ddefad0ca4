// Messages to and from the bench over UART 1 (firmware/backplane/messages.h).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "firmware/backplane/messages.h"
#include "firmware/boards/mps2_an500/uart.h"
#include "protocol/codec.h"

namespace scatter::firmware::mps2_an500 {

class BackplaneLine {
 public:
  struct Message {
    backplane::Kind kind{};
    std::span<const std::byte> payload;  ///< Valid until the next receive().
  };

  constexpr explicit BackplaneLine(Uart& uart) noexcept : uart_(uart) {}

  /// False when the line has no room for the whole message; then nothing is sent.
  template <typename M>
  [[nodiscard]] bool send(const M& message) noexcept {
    std::array<std::byte, kHeadBytes + backplane::kMaxPayload + 1> bytes{};
    const auto size = protocol::encode(message, std::span(bytes).subspan(kHeadBytes, backplane::kMaxPayload));
    return size && send(M::kKind, bytes, *size);
  }

  /// The next whole message; none yet: nullopt. A message with a wrong length or check is skipped and
  /// counted.
  [[nodiscard]] std::optional<Message> receive() noexcept;
  [[nodiscard]] std::uint32_t damaged() const noexcept { return damaged_; }

 private:
  static constexpr std::size_t kHeadBytes = 2;

  [[nodiscard]] bool send(backplane::Kind kind, std::span<std::byte> bytes, std::size_t payload) noexcept;

  Uart& uart_;
  std::array<std::byte, kHeadBytes + backplane::kMaxPayload + 1> buffer_{};
  std::size_t held_ = 0;
  std::uint32_t damaged_ = 0;
};

}  // namespace scatter::firmware::mps2_an500
