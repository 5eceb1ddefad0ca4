#include "host_sdk/firmware_files/file_bytes.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

namespace scatter::firmware_files {

Error file_error(std::string_view verb, const std::filesystem::path& file, int number) {
  std::string what = fmt::format("cannot {} {}: {}", verb, file.string(), std::strerror(number));
  switch (number) {
    case EACCES:
    case EPERM:
    case EROFS:
      return {ErrorCode::kPermissionDenied, std::move(what), "choose a place that you may use"};
    case ENOENT:
    case ENOTDIR:
      return {ErrorCode::kNotFound, std::move(what), "check the name and its folder"};
    case ENOSPC:
    case EDQUOT:
      return {ErrorCode::kResourceExhausted, std::move(what), "free some space on that disk"};
    case EISDIR:
      return {ErrorCode::kInvalidArgument, std::move(what), "name a file, not a folder"};
    default:
      return {ErrorCode::kUnavailable, std::move(what), "check the disk, then run again"};
  }
}

Result<std::vector<std::byte>> read_file(const std::filesystem::path& file, std::size_t limit) {
  const int handle = ::open(file.c_str(), O_RDONLY | O_CLOEXEC);
  if (handle < 0) {
    return std::unexpected(file_error("open", file, errno));
  }
  constexpr std::size_t kPiece = 64 * 1024;
  std::vector<std::byte> out;
  for (;;) {
    const std::size_t had = out.size();
    out.resize(had + kPiece);
    const ssize_t got = ::read(handle, out.data() + had, kPiece);
    if (got < 0 && errno == EINTR) {
      out.resize(had);
      continue;
    }
    if (got < 0) {
      const int number = errno;
      ::close(handle);
      return std::unexpected(file_error("read", file, number));
    }
    out.resize(had + std::size_t(got));
    if (got == 0) {
      break;
    }
    if (out.size() > limit) {
      ::close(handle);
      return fail(
          ErrorCode::kResourceExhausted,
          fmt::format("{} has more than {} bytes, the most that such a file can have", file.string(), limit),
          "check that this is the right file");
    }
  }
  ::close(handle);
  return out;
}

}  // namespace scatter::firmware_files
