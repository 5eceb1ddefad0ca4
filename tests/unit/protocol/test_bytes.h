// Bytes, frames and pseudo-random numbers for the protocol's tests.
#pragma once

#include <cstddef>
#include <cstdint>
#include <random>
#include <span>
#include <string_view>
#include <vector>

#include "protocol/frame.h"
#include "protocol/message_traits.h"

namespace scatter::protocol::test {

using Bytes = std::vector<std::byte>;
using Frames = std::vector<Bytes>;

inline Bytes from_hex(std::string_view hex) {
  const auto digit = [](char c) { return c <= '9' ? c - '0' : c - 'a' + 10; };
  Bytes bytes;
  for (std::size_t i = 0; i + 1 < hex.size(); i += 2) {
    bytes.push_back(static_cast<std::byte>(16 * digit(hex[i]) + digit(hex[i + 1])));
  }
  return bytes;
}

inline Bytes random_bytes(std::mt19937& random, std::size_t size) {
  Bytes bytes(size);
  for (std::byte& b : bytes) {
    b = static_cast<std::byte>(random());
  }
  return bytes;
}

inline Bytes copy(std::span<const std::byte> bytes) {
  return {bytes.begin(), bytes.end()};
}

inline void append(Bytes& bytes, std::span<const std::byte> more) {
  bytes.insert(bytes.end(), more.begin(), more.end());
}

inline Bytes make_frame(const FrameHeader& header, std::span<const std::byte> payload) {
  Bytes bytes(kFrameOverhead + payload.size());
  bytes.resize(write_frame(bytes, header, payload));
  return bytes;
}

template <WireMessage M>
Bytes make_frame(const M& message, std::uint32_t sequence = 0) {
  Bytes bytes(kMaxFrameBytes);
  bytes.resize(write_message(bytes, header_for<M>(0x1234, sequence, 7), message));
  return bytes;
}

inline Bytes flipped(Bytes bytes, std::size_t bit) {
  bytes[bit / 8] ^= static_cast<std::byte>(1U << (bit % 8));
  return bytes;
}

}  // namespace scatter::protocol::test
