// Whole small files as bytes, with errors that name file and remedy.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string_view>
#include <vector>

#include "host_sdk/error/error.h"

namespace scatter::firmware_files {

/// Error for a failed system call; `number` is errno.
[[nodiscard]] Error file_error(std::string_view verb, const std::filesystem::path& file, int number);

/// Errors  kNotFound, kPermissionDenied, kUnavailable; kResourceExhausted: larger than `limit` bytes.
[[nodiscard]] Result<std::vector<std::byte>> read_file(const std::filesystem::path& file, std::size_t limit);

}  // namespace scatter::firmware_files
