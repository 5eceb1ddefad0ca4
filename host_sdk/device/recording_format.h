// Bytes of a recording (RECORDING.md). Internal to this wing.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "host_sdk/device/recording_writer.h"
#include "protocol/crc.h"
#include "protocol/endian.h"

namespace scatter::device::recording {

/// 0x89 marks a binary file, CR LF and 0x1A show transfers that mangle text.
inline constexpr std::array<std::uint8_t, 8> kFileMagic{0x89, 'S', 'C', 'A', 'T', '\r', '\n', 0x1A};
inline constexpr std::uint16_t kVersionMajor = 1;
inline constexpr std::uint16_t kVersionMinor = 0;
inline constexpr std::size_t kFileHeaderBytes = 80;
inline constexpr std::size_t kToolBytes = 48;

inline constexpr std::uint32_t kRecordMagic = 0x43455253;  ///< "SREC"
inline constexpr std::size_t kRecordHeaderBytes = 32;
inline constexpr std::size_t kAlignment = 8;
inline constexpr std::size_t kIndexEntryBytes = 16;
inline constexpr std::size_t kEndPayloadBytes = 16;
inline constexpr std::size_t kEndRecordBytes = kRecordHeaderBytes + kEndPayloadBytes;

enum class RecordType : std::uint16_t {
  kAttachment = 1,
  kWire = 2,
  kConfiguration = 3,
  kNote = 4,
  kIndex = 5,
  kEnd = 6,
};

struct RecordHeader {
  RecordType type = RecordType::kNote;
  std::uint16_t message = 0;  ///< Wire records: the frame's message id; else 0.
  std::uint64_t host_time_unix_ns = 0;
  std::uint32_t length = 0;       ///< Of the payload, without padding.
  std::uint32_t payload_crc = 0;  ///< 0 for wire records: the frame carries its own checksums.
};

[[nodiscard]] constexpr std::uint64_t padded(std::uint64_t bytes) noexcept {
  return (bytes + (kAlignment - 1)) & ~static_cast<std::uint64_t>(kAlignment - 1);
}

using RecordHeaderBytes = std::array<std::byte, kRecordHeaderBytes>;

[[nodiscard]] inline RecordHeaderBytes encode(const RecordHeader& header) noexcept {
  RecordHeaderBytes out{};
  protocol::store_le(out.data(), kRecordMagic);
  protocol::store_le(out.data() + 4, header.type);
  protocol::store_le(out.data() + 6, header.message);
  protocol::store_le(out.data() + 8, header.host_time_unix_ns);
  protocol::store_le(out.data() + 16, header.length);
  protocol::store_le(out.data() + 20, header.payload_crc);
  protocol::store_le(out.data() + 28, protocol::crc32c(std::span<const std::byte>(out).first(28)));
  return out;
}

/// The header at the start of `bytes`; nullopt when its magic or checksum is wrong.
[[nodiscard]] inline std::optional<RecordHeader> decode_header(std::span<const std::byte> bytes) noexcept {
  if (bytes.size() < kRecordHeaderBytes || protocol::load_le<std::uint32_t>(bytes.data()) != kRecordMagic ||
      protocol::crc32c(bytes.first(28)) != protocol::load_le<std::uint32_t>(bytes.data() + 28)) {
    return std::nullopt;
  }
  RecordHeader header;
  header.type = protocol::load_le<RecordType>(bytes.data() + 4);
  header.message = protocol::load_le<std::uint16_t>(bytes.data() + 6);
  header.host_time_unix_ns = protocol::load_le<std::uint64_t>(bytes.data() + 8);
  header.length = protocol::load_le<std::uint32_t>(bytes.data() + 16);
  header.payload_crc = protocol::load_le<std::uint32_t>(bytes.data() + 20);
  return header;
}

using FileHeaderBytes = std::array<std::byte, kFileHeaderBytes>;

[[nodiscard]] inline FileHeaderBytes encode_file_header(const RecordingInfo& info) noexcept {
  FileHeaderBytes out{};
  for (std::size_t i = 0; i < kFileMagic.size(); ++i) {
    out[i] = static_cast<std::byte>(kFileMagic[i]);
  }
  protocol::store_le(out.data() + 8, kVersionMajor);
  protocol::store_le(out.data() + 10, kVersionMinor);
  protocol::store_le(out.data() + 12, static_cast<std::uint32_t>(kFileHeaderBytes));
  protocol::store_le(out.data() + 16, info.creation_unix_ns);
  for (std::size_t i = 0; i < std::min(info.tool.size(), kToolBytes); ++i) {
    out[24 + i] = static_cast<std::byte>(info.tool[i]);
  }
  protocol::store_le(out.data() + 76, protocol::crc32c(std::span<const std::byte>(out).first(76)));
  return out;
}

}  // namespace scatter::device::recording
