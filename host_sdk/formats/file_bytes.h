// Whole files in and out of memory; the only place in formats that touches the file system.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "host_sdk/error/error.h"

namespace scatter::formats {

/// Contents of a regular file.
/// Errors  kNotFound: no such file; kInvalidArgument: a directory, a pipe or a device;
///         kPermissionDenied; kResourceExhausted: more than 4 GiB; kDataLoss: shrank while reading.
[[nodiscard]] Result<std::string> read_file(const std::filesystem::path& path);

/// Replaces a file as a whole: readers see the old or the new contents, and a full disk leaves
/// the old ones.
/// Errors  kResourceExhausted or kPermissionDenied, with the path.
[[nodiscard]] Status write_file(const std::filesystem::path& path, std::string_view bytes);

}  // namespace scatter::formats
