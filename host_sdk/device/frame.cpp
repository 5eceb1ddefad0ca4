#include "host_sdk/device/frame.h"

#include <bit>
#include <cstring>
#include <string>

#include "protocol/endian.h"

namespace scatter::device {

namespace {

/// Up to eight bytes, little endian.
std::uint64_t load_some(const std::byte* at, std::size_t count) noexcept {
  std::uint64_t value = 0;
  for (std::size_t i = 0; i < count; ++i) {
    value |= static_cast<std::uint64_t>(at[i]) << (8 * i);
  }
  return value;
}

}  // namespace

std::string_view name(FrameStatus status) noexcept {
  switch (status) {
    case FrameStatus::kComplete:
      return "complete";
    case FrameStatus::kIncomplete:
      return "incomplete";
    case FrameStatus::kCorrupt:
      return "corrupt";
  }
  return "corrupt";
}

std::uint64_t packed_bytes(protocol::PixelFormat format, std::uint64_t pixel_count) noexcept {
  switch (format) {
    case protocol::PixelFormat::kMono16:
      return pixel_count * 2;
    case protocol::PixelFormat::kMono10p:
      return (pixel_count * 10 + 7) / 8;
    case protocol::PixelFormat::kMono12p:
      return (pixel_count * 12 + 7) / 8;
  }
  return 0;
}

void unpack_mono10p(std::span<const std::byte> packed, std::span<std::uint16_t> out) noexcept {
  std::size_t in = 0;
  std::size_t at = 0;
  // Four pixels in five bytes; one eight-byte load while that many are there.
  for (; at + 4 <= out.size() && in + 8 <= packed.size(); at += 4, in += 5) {
    const auto bits = protocol::load_le<std::uint64_t>(packed.data() + in);
    for (std::size_t k = 0; k < 4; ++k) {
      out[at + k] = static_cast<std::uint16_t>((bits >> (10 * k)) & 0x3FFU);
    }
  }
  while (at < out.size()) {
    const std::uint64_t bits = load_some(packed.data() + in, std::min<std::size_t>(5, packed.size() - in));
    for (std::size_t k = 0; k < 4 && at < out.size(); ++k, ++at) {
      out[at] = static_cast<std::uint16_t>((bits >> (10 * k)) & 0x3FFU);
    }
    in += 5;
  }
}

void unpack_mono12p(std::span<const std::byte> packed, std::span<std::uint16_t> out) noexcept {
  std::size_t in = 0;
  std::size_t at = 0;
  for (; at + 4 <= out.size() && in + 8 <= packed.size(); at += 4, in += 6) {
    const auto bits = protocol::load_le<std::uint64_t>(packed.data() + in);
    for (std::size_t k = 0; k < 4; ++k) {
      out[at + k] = static_cast<std::uint16_t>((bits >> (12 * k)) & 0xFFFU);
    }
  }
  while (at < out.size()) {
    const std::uint64_t bits = load_some(packed.data() + in, std::min<std::size_t>(3, packed.size() - in));
    for (std::size_t k = 0; k < 2 && at < out.size(); ++k, ++at) {
      out[at] = static_cast<std::uint16_t>((bits >> (12 * k)) & 0xFFFU);
    }
    in += 3;
  }
}

Status unpack(const Frame& frame, std::span<std::uint16_t> out) {
  if (frame.status != FrameStatus::kComplete) {
    return fail(ErrorCode::kFailedPrecondition,
                "frame " + std::to_string(frame.begin.frame_id) + " is " + std::string(name(frame.status)),
                "use complete frames only, or measure again");
  }
  const std::span<const std::byte> bytes = frame.bytes();
  if (out.size() != frame.pixel_count() ||
      bytes.size() != packed_bytes(frame.begin.pixel_format, frame.pixel_count())) {
    return fail(ErrorCode::kInvalidArgument,
                "frame " + std::to_string(frame.begin.frame_id) + " has " +
                    std::to_string(frame.pixel_count()) + " pixels, there is room for " +
                    std::to_string(out.size()),
                "give room for width x height pixels");
  }
  switch (frame.begin.pixel_format) {
    case protocol::PixelFormat::kMono16:
      if constexpr (std::endian::native == std::endian::little) {
        if (!bytes.empty()) {
          std::memcpy(out.data(), bytes.data(), bytes.size());
        }
      } else {
        for (std::size_t k = 0; k < out.size(); ++k) {
          out[k] = protocol::load_le<std::uint16_t>(bytes.data() + 2 * k);
        }
      }
      return {};
    case protocol::PixelFormat::kMono10p:
      unpack_mono10p(bytes, out);
      return {};
    case protocol::PixelFormat::kMono12p:
      unpack_mono12p(bytes, out);
      return {};
  }
  return fail(ErrorCode::kInvalidArgument, "frame has an unknown pixel format", "update the host's software");
}

}  // namespace scatter::device
