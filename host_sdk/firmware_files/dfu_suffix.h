// The suffix of USB DFU 1.1 (appendix B) that makes a firmware file a .dfu file; see README.md.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include "host_sdk/error/error.h"

namespace scatter::firmware_files {

inline constexpr std::size_t kDfuSuffixBytes = 16;
inline constexpr std::uint16_t kDfuVendor = 0x1209;
/// Matches any device or vendor.
inline constexpr std::uint16_t kDfuAny = 0xFFFF;
using DfuSuffix = std::array<std::byte, kDfuSuffixBytes>;

/// The suffix for these contents.
[[nodiscard]] DfuSuffix dfu_suffix(std::span<const std::byte> contents) noexcept;

/// The contents before the suffix.
/// Errors  kDataLoss: no suffix, a wrong length or checksum; kInvalidArgument: another vendor's device, or
///         another format (DfuSe's 0x011A). `file` names it in messages.
[[nodiscard]] Result<std::span<const std::byte>> strip_dfu_suffix(std::span<const std::byte> bytes,
                                                                  std::string_view file);

}  // namespace scatter::firmware_files
