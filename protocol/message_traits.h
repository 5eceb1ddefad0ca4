// What a message's id says about it: direction, channel and reply. Derived from AllMessages.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>
#include <tuple>
#include <utility>

#include "protocol/codec.h"
#include "protocol/frame.h"
#include "protocol/messages.h"

namespace scatter::protocol {

/// A struct that travels as the payload of a frame.
template <typename M>
concept WireMessage = Message<M> && requires {
  M::kId;
  M::kName;
  M::kMeaning;
};

enum class Direction : std::uint8_t { kHostToDevice, kDeviceToHost };

/// Ids by range: 0x0001..0x00FF host to device, 0x0100..0x01FF stream, 0x0200..0x02FF device events,
/// 0x8000..0xFFFF replies.
[[nodiscard]] constexpr Direction direction_of(MessageId id) noexcept {
  return static_cast<std::uint16_t>(id) < 0x0100 ? Direction::kHostToDevice : Direction::kDeviceToHost;
}

/// Channel on which a message travels. The transfer channel is kept for later; no message uses it.
[[nodiscard]] constexpr Channel channel_of(MessageId id) noexcept {
  const auto number = static_cast<std::uint16_t>(id);
  if (id == MessageId::kCredit || (number & 0xFF00U) == 0x0200U) {
    return Channel::kEvent;
  }
  if ((number & 0xFF00U) == 0x0100U) {
    return Channel::kStream;
  }
  return Channel::kControl;
}

[[nodiscard]] constexpr std::string_view name_of(Direction direction) noexcept {
  return direction == Direction::kHostToDevice ? "host to device" : "device to host";
}

[[nodiscard]] constexpr std::string_view name_of(Channel channel) noexcept {
  constexpr std::array<std::string_view, kChannels> kNames{"control", "event", "stream", "transfer"};
  const auto index = static_cast<std::size_t>(channel);
  return index < kChannels ? kNames[index] : "unknown";
}

/// Calls visit.operator()<M>() for every message, in the order of SPEC.md.
template <typename Visit>
constexpr void for_each_message(Visit&& visit) {
  [&]<std::size_t... I>(std::index_sequence<I...>) {
    (visit.template operator()<std::tuple_element_t<I, AllMessages>>(), ...);
  }(std::make_index_sequence<std::tuple_size_v<AllMessages>>{});
}

/// True for ids of AllMessages.
[[nodiscard]] constexpr bool is_known(MessageId id) noexcept {
  bool found = false;
  for_each_message([&]<typename M>() { found = found || M::kId == id; });
  return found;
}

/// True for messages that get exactly one reply.
[[nodiscard]] constexpr bool is_request(MessageId id) noexcept {
  return direction_of(id) == Direction::kHostToDevice && channel_of(id) != Channel::kEvent;
}

/// The message that answers a request when it succeeds: the one with bit 15 set when there is such a
/// message, run_report for abort, status_reply otherwise. Failures are answered by status_reply.
[[nodiscard]] constexpr MessageId reply_of(MessageId request) noexcept {
  if (request == MessageId::kAbort) {
    return MessageId::kRunReport;
  }
  const auto reply = static_cast<MessageId>(static_cast<std::uint16_t>(request) | 0x8000U);
  return is_known(reply) ? reply : MessageId::kStatusReply;
}

/// Name of SPEC.md; "unknown" for ids that do not exist.
[[nodiscard]] constexpr std::string_view name_of(MessageId id) noexcept {
  std::string_view name = "unknown";
  for_each_message([&]<typename M>() {
    if (M::kId == id) {
      name = M::kName;
    }
  });
  return name;
}

/// Header for message M on its own channel.
template <WireMessage M>
[[nodiscard]] constexpr FrameHeader header_for(std::uint16_t session, std::uint32_t sequence,
                                               std::uint16_t correlation = 0) noexcept {
  FrameHeader header;
  header.channel = channel_of(M::kId);
  header.message = static_cast<std::uint16_t>(M::kId);
  header.sequence = sequence;
  header.session = session;
  header.correlation = correlation;
  return header;
}

}  // namespace scatter::protocol
