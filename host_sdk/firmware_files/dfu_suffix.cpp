#include "host_sdk/firmware_files/dfu_suffix.h"

#include <fmt/format.h>

#include <algorithm>

#include "protocol/endian.h"

namespace scatter::firmware_files {
namespace {

using protocol::load_le;
using protocol::store_le;

constexpr std::uint16_t kDfuFormat = 0x0100;

/// Offsets in the suffix.
constexpr std::size_t kDevice = 0;
constexpr std::size_t kProduct = 2;
constexpr std::size_t kVendor = 4;
constexpr std::size_t kFormat = 6;
constexpr std::size_t kMark = 8;
constexpr std::size_t kLength = 11;
constexpr std::size_t kChecksum = 12;
constexpr std::array kMarkBytes = {std::byte{'U'}, std::byte{'F'}, std::byte{'D'}};

constexpr std::array<std::uint32_t, 256> make_table() {
  std::array<std::uint32_t, 256> table{};
  for (std::uint32_t k = 0; k < table.size(); ++k) {
    std::uint32_t crc = k;
    for (int bit = 0; bit < 8; ++bit) {
      crc = (crc >> 1U) ^ ((crc & 1U) != 0 ? 0xEDB8'8320U : 0U);
    }
    table[k] = crc;
  }
  return table;
}
constexpr auto kTable = make_table();

/// IEEE 802.3's polynomial, reflected, from 0xFFFFFFFF, without the final inversion.
std::uint32_t crc_of(std::span<const std::byte> bytes, std::uint32_t crc = 0xFFFF'FFFFU) noexcept {
  for (const std::byte b : bytes) {
    crc = (crc >> 8U) ^ kTable[(crc ^ static_cast<std::uint32_t>(b)) & 0xFFU];
  }
  return crc;
}

}  // namespace

DfuSuffix dfu_suffix(std::span<const std::byte> contents) noexcept {
  DfuSuffix out{};
  store_le(out.data() + kDevice, kDfuAny);
  store_le(out.data() + kProduct, kDfuAny);
  store_le(out.data() + kVendor, kDfuVendor);
  store_le(out.data() + kFormat, kDfuFormat);
  std::ranges::copy(kMarkBytes, out.begin() + kMark);
  out[kLength] = std::byte{kDfuSuffixBytes};
  store_le(out.data() + kChecksum, crc_of(std::span(out).first(kChecksum), crc_of(contents)));
  return out;
}

Result<std::span<const std::byte>> strip_dfu_suffix(std::span<const std::byte> bytes, std::string_view file) {
  const auto damaged = [&](const std::string& why) {
    return fail(ErrorCode::kDataLoss, fmt::format("{}: {}", file, why), "download or build the file again");
  };
  if (bytes.size() < kDfuSuffixBytes) {
    return damaged(fmt::format("has {} bytes, too short for a DFU suffix of 16", bytes.size()));
  }
  const auto contents = bytes.first(bytes.size() - kDfuSuffixBytes);
  const auto suffix = bytes.last(kDfuSuffixBytes);
  if (!std::ranges::equal(suffix.subspan(kMark, kMarkBytes.size()), kMarkBytes)) {
    return damaged("has no DFU suffix at its end (\"UFD\" 8 bytes before it)");
  }
  if (suffix[kLength] != std::byte{kDfuSuffixBytes}) {
    return damaged(
        fmt::format("DFU suffix: length is {} when it should be 16", static_cast<unsigned>(suffix[kLength])));
  }
  const auto found = load_le<std::uint32_t>(suffix.data() + kChecksum);
  const auto expected = crc_of(bytes.first(bytes.size() - 4));
  if (found != expected) {
    return damaged(fmt::format("DFU suffix: checksum is {:08x} when it should be {:08x}", found, expected));
  }
  const auto format = load_le<std::uint16_t>(suffix.data() + kFormat);
  const auto vendor = load_le<std::uint16_t>(suffix.data() + kVendor);
  if (format != kDfuFormat || (vendor != kDfuVendor && vendor != kDfuAny)) {
    return fail(ErrorCode::kInvalidArgument,
                fmt::format("{}: DFU suffix: format {:04x} for vendor {:04x}, expected 0100 and 1209", file,
                            format, vendor),
                "name a firmware file of this instrument");
  }
  return contents;
}

}  // namespace scatter::firmware_files
