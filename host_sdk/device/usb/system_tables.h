// Reads from the system's tables (sysfs, procfs). They never fail: what is missing or garbled reads as
// nothing. Internal to this folder.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace scatter::device::usb {

/// At most `most` bytes of a file.
[[nodiscard]] std::vector<std::byte> file_bytes(const std::filesystem::path& path, std::size_t most);
/// One attribute without its line end; bytes that would disturb a terminal become '?'. At most 256 bytes.
[[nodiscard]] std::string attribute(const std::filesystem::path& path);
/// Names in a folder, sorted, without "." and "..".
[[nodiscard]] std::vector<std::string> names_in(const std::filesystem::path& folder);
/// Where a link points, as text; "" when it is none.
[[nodiscard]] std::string link_target(const std::filesystem::path& link);
/// The whole text as a number; nothing when it is none or too big.
[[nodiscard]] std::optional<std::uint32_t> number(std::string_view text, int base) noexcept;

}  // namespace scatter::device::usb
