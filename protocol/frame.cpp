#include "protocol/frame.h"

#include <algorithm>
#include <cstring>

#include "protocol/crc.h"
#include "protocol/endian.h"

namespace scatter::protocol {

struct ParseAccess {
  static Frame make(const FrameHeader& header, std::span<const std::byte> bytes) noexcept {
    Frame frame;
    frame.header_ = header;
    frame.bytes_ = bytes;
    return frame;
  }
};

namespace {

constexpr auto kMagicLow = static_cast<std::byte>(kMagic & 0xFFU);
constexpr auto kMagicHigh = static_cast<std::byte>(kMagic >> 8U);
constexpr std::size_t kHeaderCrcAt = 20;

/// First place at or after `from` where a frame may start; bytes.size() when nowhere.
std::size_t next_start(std::span<const std::byte> bytes, std::size_t from) noexcept {
  while (from < bytes.size()) {
    const void* found = std::memchr(bytes.data() + from, static_cast<int>(kMagicLow), bytes.size() - from);
    if (found == nullptr) {
      return bytes.size();
    }
    from = static_cast<std::size_t>(static_cast<const std::byte*>(found) - bytes.data());
    if (from + 1 == bytes.size() || bytes[from + 1] == kMagicHigh) {
      return from;
    }
    ++from;
  }
  return bytes.size();
}

FrameHeader read_header(const std::byte* at) noexcept {
  FrameHeader header;
  header.wire_major = load_le<std::uint8_t>(at + 2);
  header.channel = load_le<Channel>(at + 3);
  header.incompatible_flags = load_le<std::uint8_t>(at + 4);
  header.compatible_flags = load_le<std::uint8_t>(at + 5);
  header.message = load_le<std::uint16_t>(at + 6);
  header.payload_length = load_le<std::uint32_t>(at + 8);
  header.sequence = load_le<std::uint32_t>(at + 12);
  header.session = load_le<std::uint16_t>(at + 16);
  header.correlation = load_le<std::uint16_t>(at + 18);
  return header;
}

ParseStatus judge(const FrameHeader& header) noexcept {
  if (header.wire_major != kWireMajor) {
    return ParseStatus::kBadVersion;
  }
  if ((header.incompatible_flags & ~kKnownIncompatibleFlags) != 0) {
    return ParseStatus::kUnknownFlags;
  }
  if (static_cast<std::size_t>(header.channel) >= kChannels) {
    return ParseStatus::kUnknownChannel;
  }
  return ParseStatus::kFrame;
}

}  // namespace

ParseResult parse_frame(std::span<const std::byte> bytes, std::uint32_t max_payload) noexcept {
  ParseResult result;
  const std::size_t start = next_start(bytes, 0);
  if (start != 0) {
    result.status = ParseStatus::kNoMagic;
    result.consumed = start;
    return result;
  }
  if (bytes.size() < kHeaderBytes) {
    result.missing = kHeaderBytes - bytes.size();
    return result;
  }
  if (crc32c(bytes.first(kHeaderCrcAt)) != load_le<std::uint32_t>(bytes.data() + kHeaderCrcAt)) {
    result.status = ParseStatus::kBadHeader;
    result.consumed = 1;
    return result;
  }
  result.header = read_header(bytes.data());
  if (result.header.payload_length > max_payload) {
    result.status = ParseStatus::kBadLength;
    result.consumed = 1;
    return result;
  }
  const std::size_t length = result.header.payload_length;
  const std::size_t whole = kFrameOverhead + length;
  if (bytes.size() < whole) {
    result.missing = whole - bytes.size();
    return result;
  }
  if (crc32c(bytes.subspan(kHeaderBytes, length)) !=
      load_le<std::uint32_t>(bytes.data() + kHeaderBytes + length)) {
    // Only the first byte is given up: a whole frame may lie in what this one claimed.
    result.status = ParseStatus::kBadPayload;
    result.consumed = 1;
    return result;
  }
  result.status = judge(result.header);
  result.consumed = whole;
  if (result.status == ParseStatus::kFrame) {
    result.frame = ParseAccess::make(result.header, bytes.first(whole));
  }
  return result;
}

std::size_t finish_frame(std::span<std::byte> out, const FrameHeader& header,
                         std::size_t payload_length) noexcept {
  const std::size_t whole = kFrameOverhead + payload_length;
  if (payload_length > kMaxPayload || out.size() < whole) {
    return 0;
  }
  std::byte* at = out.data();
  store_le(at, kMagic);
  store_le(at + 2, header.wire_major);
  store_le(at + 3, header.channel);
  store_le(at + 4, header.incompatible_flags);
  store_le(at + 5, header.compatible_flags);
  store_le(at + 6, header.message);
  store_le(at + 8, static_cast<std::uint32_t>(payload_length));
  store_le(at + 12, header.sequence);
  store_le(at + 16, header.session);
  store_le(at + 18, header.correlation);
  store_le(at + kHeaderCrcAt, crc32c(out.first(kHeaderCrcAt)));
  store_le(at + kHeaderBytes + payload_length, crc32c(out.subspan(kHeaderBytes, payload_length)));
  return whole;
}

std::size_t write_frame(std::span<std::byte> out, const FrameHeader& header,
                        std::span<const std::byte> payload) noexcept {
  if (payload.size() > kMaxPayload || out.size() < kFrameOverhead + payload.size()) {
    return 0;
  }
  if (!payload.empty()) {
    std::memmove(out.data() + kHeaderBytes, payload.data(), payload.size());
  }
  return finish_frame(out, header, payload.size());
}

}  // namespace scatter::protocol
