// Stored objects, read in chunks: the descriptor (encoded once) and the factory maps.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "firmware/ports/ports.h"
#include "protocol/codec.h"
#include "protocol/descriptor.h"

namespace scatter::firmware {

class ObjectServer {
 public:
  /// Largest chunk [B]; the host asks on for the rest.
  static constexpr std::uint32_t kMaxChunk = 4096;

  explicit ObjectServer(Factory& factory) noexcept;

  /// kOk and `chunk` filled (at most `max_data` bytes, a view into the object), kNotFound for an unknown
  /// or empty object, kOutOfRange for an offset past its end (`chunk.total` is set).
  [[nodiscard]] protocol::StatusCode read(const protocol::ObjectRead& request, std::uint32_t max_data,
                                          protocol::ObjectChunk& chunk) noexcept;

 private:
  struct KnownCrc {
    bool known = false;
    std::uint32_t crc = 0;
  };
  [[nodiscard]] std::span<const std::byte> bytes_of(protocol::ObjectId id) noexcept;
  [[nodiscard]] std::uint32_t crc_of(protocol::ObjectId id, std::span<const std::byte> bytes) noexcept;

  Factory& factory_;
  std::array<std::byte, protocol::max_encoded_size<protocol::Descriptor>()> descriptor_{};
  std::size_t descriptor_size_ = 0;
  std::array<KnownCrc, 3> crcs_{};  // One per ObjectId.
};

}  // namespace scatter::firmware
