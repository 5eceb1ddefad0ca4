#include "firmware/core/object_server.h"

#include <algorithm>

#include "protocol/crc.h"

namespace scatter::firmware {

using protocol::ObjectId;
using protocol::StatusCode;

ObjectServer::ObjectServer(Factory& factory) noexcept : factory_(factory) {
  // Cannot fail: the buffer has the largest size a descriptor can have.
  descriptor_size_ = protocol::encode(factory.descriptor(), descriptor_).value_or(0);
}

std::span<const std::byte> ObjectServer::bytes_of(ObjectId id) noexcept {
  switch (id) {
    case ObjectId::kDescriptor:
      return {descriptor_.data(), descriptor_size_};
    case ObjectId::kHotPixels:
    case ObjectId::kPrnuMap:
      return factory_.object(id);
  }
  return {};
}

std::uint32_t ObjectServer::crc_of(ObjectId id, std::span<const std::byte> bytes) noexcept {
  KnownCrc& entry = crcs_[static_cast<std::size_t>(id) - 1];
  if (!entry.known) {
    entry.crc = protocol::crc32c(bytes);
    entry.known = true;
  }
  return entry.crc;
}

StatusCode ObjectServer::read(const protocol::ObjectRead& request, std::uint32_t max_data,
                              protocol::ObjectChunk& chunk) noexcept {
  const auto id = static_cast<ObjectId>(request.object);
  const std::span<const std::byte> bytes = bytes_of(id);
  if (bytes.empty()) {
    return StatusCode::kNotFound;
  }
  chunk.object = request.object;
  chunk.offset = request.offset;
  chunk.total = static_cast<std::uint32_t>(bytes.size());
  if (request.offset > bytes.size()) {
    return StatusCode::kOutOfRange;
  }
  chunk.object_crc = crc_of(id, bytes);
  const std::span<const std::byte> rest = bytes.subspan(request.offset);
  chunk.data = rest.first(std::min<std::size_t>({rest.size(), request.length, max_data, kMaxChunk}));
  return StatusCode::kOk;
}

}  // namespace scatter::firmware
