// Writing results: whole or not at all.
#pragma once

#include <filesystem>
#include <functional>
#include <string_view>

#include "host_sdk/error/error.h"

namespace scatter::cli {

/// Creates the folder and its parents when missing, and makes sure that files can be made in it.
/// Errors   kPermissionDenied, kFailedPrecondition (something else has that name), kResourceExhausted.
[[nodiscard]] Status prepare_folder(const std::filesystem::path& folder);

/// Lets `write` make a file under a temporary name beside `path`, then renames it. After an error the
/// temporary file is gone and an older file of that name is untouched. A path that exists and is no regular
/// file
/// (/dev/stdout, a pipe) is written directly.
/// Errors   of `write`, and as write_file.
[[nodiscard]] Status write_atomically(const std::filesystem::path& path,
                                      const std::function<Status(const std::filesystem::path&)>& write);

/// Writes bytes; `path` is the name in messages and, unless it is no regular file, replaced in one step.
/// Errors   kPermissionDenied, kNotFound (folder), kResourceExhausted (disk full), kUnavailable (other).
[[nodiscard]] Status write_file(const std::filesystem::path& path, std::string_view bytes);

}  // namespace scatter::cli
