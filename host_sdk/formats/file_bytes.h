// Whole files in and out of memory; the only place in formats that touches the file system.
#pragma once

#include <cstddef>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>

#include "host_sdk/error/error.h"

namespace scatter::formats {

/// Contents of a regular file.
/// Errors  kNotFound: no such file; kInvalidArgument: a directory, a pipe or a device;
///         kPermissionDenied; kResourceExhausted: more than 4 GiB; kDataLoss: shrank while reading.
[[nodiscard]] Result<std::string> read_file(const std::filesystem::path& path);

/// Memory as large as a file, which may be shared, with its bytes in place as floats: what stands at a
/// multiple of 4 bytes can be used where it is.
class FileBlock {
 public:
  /// Room for `size` bytes, not set to anything.
  explicit FileBlock(std::size_t size);
  explicit FileBlock(std::string_view bytes);

  [[nodiscard]] char* data() noexcept { return reinterpret_cast<char*>(floats_.get()); }
  [[nodiscard]] std::string_view bytes() const noexcept {
    return {reinterpret_cast<const char*>(floats_.get()), size_};
  }
  [[nodiscard]] const std::shared_ptr<float[]>& floats() const noexcept { return floats_; }

 private:
  std::shared_ptr<float[]> floats_;
  std::size_t size_ = 0;
};

/// As read_file.
[[nodiscard]] Result<FileBlock> read_file_block(const std::filesystem::path& path);

/// Replaces a file as a whole: readers see the old or the new contents, and a full disk leaves
/// the old ones.
/// Errors  kResourceExhausted or kPermissionDenied, with the path.
[[nodiscard]] Status write_file(const std::filesystem::path& path, std::string_view bytes);

}  // namespace scatter::formats
