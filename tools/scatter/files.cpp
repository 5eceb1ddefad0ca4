#include "tools/scatter/files.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <system_error>

namespace scatter::cli {
namespace {

namespace fs = std::filesystem;

std::unexpected<Error> cannot(const char* verb, const fs::path& path, int number) {
  const std::string what = fmt::format("cannot {} {}: {}", verb, path.string(), std::strerror(number));
  switch (number) {
    case EACCES:
    case EPERM:
    case EROFS:
      return fail(ErrorCode::kPermissionDenied, what, "choose a place that you may write to, with -o");
    case ENOENT:
    case ENOTDIR:
      return fail(ErrorCode::kNotFound, what, "create the folder first, or choose another with -o");
    case ENOSPC:
    case EDQUOT:
    case EFBIG:
      return fail(ErrorCode::kResourceExhausted, what,
                  "free some space on that disk, or choose another with -o");
    case EISDIR:
    case EEXIST:
      return fail(ErrorCode::kFailedPrecondition, what, "choose another name with -o");
    default:
      return fail(ErrorCode::kUnavailable, what, "check the disk, then run again");
  }
}

Status write_bytes(const fs::path& path, const fs::path& shown, std::string_view bytes) {
  const int file = ::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
  if (file < 0) {
    return cannot("create", shown, errno);
  }
  while (!bytes.empty()) {
    const ssize_t written = ::write(file, bytes.data(), bytes.size());
    if (written < 0) {
      if (errno == EINTR) {
        continue;
      }
      const int number = errno;
      ::close(file);
      return cannot("write", shown, number);
    }
    bytes.remove_prefix(std::size_t(written));
  }
  if (::close(file) != 0) {
    return cannot("write", shown, errno);
  }
  return {};
}

}  // namespace

Status prepare_folder(const fs::path& folder) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) {
    return cannot("create the folder", folder, error.value());
  }
  if (!fs::is_directory(folder, error)) {
    return cannot("create the folder", folder, EEXIST);
  }
  if (::access(folder.c_str(), W_OK | X_OK) != 0) {
    return cannot("write into", folder, errno);
  }
  return {};
}

Status write_atomically(const fs::path& path, const std::function<Status(const fs::path&)>& write) {
  std::error_code error;
  const auto status = fs::status(path, error);
  if (fs::exists(status) && !fs::is_regular_file(status)) {
    return fs::is_directory(status) ? cannot("write", path, EISDIR) : write(path);
  }
  fs::path temporary = path;
  // The extension stays: some libraries go by it.
  temporary.replace_filename(
      fmt::format(".{}.{}{}", path.stem().string(), ::getpid(), path.extension().string()));
  if (auto written = write(temporary); !written) {
    fs::remove(temporary, error);
    Error problem = std::move(written.error());
    // The person knows the file by its own name.
    const std::string internal = temporary.string();
    for (auto at = problem.what.find(internal); at != std::string::npos; at = problem.what.find(internal)) {
      problem.what.replace(at, internal.size(), path.string());
    }
    return std::unexpected(std::move(problem));
  }
  fs::rename(temporary, path, error);
  if (error) {
    const int number = error.value();
    fs::remove(temporary, error);
    return cannot("write", path, number);
  }
  return {};
}

Status write_file(const fs::path& path, std::string_view bytes) {
  return write_atomically(path, [&](const fs::path& place) { return write_bytes(place, path, bytes); });
}

}  // namespace scatter::cli
