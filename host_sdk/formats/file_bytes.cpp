#include "host_sdk/formats/file_bytes.h"

#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <system_error>

#include "host_sdk/memory/shared_block.h"

namespace scatter::formats {
namespace {

namespace fs = std::filesystem;
constexpr std::uintmax_t kLargestFile = std::uintmax_t{4} << 30;

std::unexpected<Error> cannot(ErrorCode code, const fs::path& path, std::string_view what,
                              std::string_view remedy) {
  return fail(code, fmt::format("{}: {}", path.string(), what), std::string(remedy));
}

/// Error of the last failed stream operation. iostreams keep errno on all our platforms.
std::unexpected<Error> stream_error(const fs::path& path, std::string_view action) {
  const int number = errno;
  const std::string what =
      fmt::format("cannot {}: {}", action, std::generic_category().message(number == 0 ? EIO : number));
  if (number == EACCES || number == EPERM || number == EROFS) {
    return cannot(ErrorCode::kPermissionDenied, path, what, "check the permissions of the file and folder");
  }
  if (number == ENOENT) {
    return cannot(ErrorCode::kNotFound, path, what, "create the folder first or correct the path");
  }
  return cannot(ErrorCode::kResourceExhausted, path, what, "free space on the disk or choose another folder");
}

struct OpenFile {
  std::ifstream stream;
  std::size_t size = 0;
};

/// Without a buffer: what is read goes to where it is wanted.
Result<OpenFile> open_file(const fs::path& path) {
  std::error_code error;
  const fs::file_status status = fs::status(path, error);
  if (status.type() == fs::file_type::not_found) {
    return cannot(ErrorCode::kNotFound, path, "no such file", "check the path");
  }
  if (status.type() == fs::file_type::directory) {
    return cannot(ErrorCode::kInvalidArgument, path, "is a folder, expected a file", "name a file inside it");
  }
  if (error) {
    return cannot(ErrorCode::kPermissionDenied, path, error.message(), "check the permissions");
  }
  if (status.type() != fs::file_type::regular) {
    return cannot(ErrorCode::kInvalidArgument, path, "is a pipe or a device, expected a regular file",
                  "save it to a file first");
  }
  const std::uintmax_t size = fs::file_size(path, error);
  if (error || size > kLargestFile) {
    return cannot(ErrorCode::kResourceExhausted, path, fmt::format("has {} bytes, the limit is 4 GiB", size),
                  "split the file");
  }
  OpenFile file;
  file.size = static_cast<std::size_t>(size);
  errno = 0;
  file.stream.rdbuf()->pubsetbuf(nullptr, 0);
  file.stream.open(path, std::ios::binary);
  if (!file.stream) {
    return stream_error(path, "open it");
  }
  return file;
}

Status read_all(const fs::path& path, OpenFile& file, char* to) {
  file.stream.read(to, static_cast<std::streamsize>(file.size));
  if (file.stream.gcount() != static_cast<std::streamsize>(file.size)) {
    return cannot(ErrorCode::kDataLoss, path,
                  fmt::format("gave {} of {} bytes", file.stream.gcount(), file.size),
                  "check that nothing else writes the file");
  }
  return {};
}

}  // namespace

Result<std::string> read_file(const fs::path& path) {
  auto file = open_file(path);
  if (!file) {
    return std::unexpected(file.error());
  }
  std::string bytes;
  Status status;
  // No zeros first: the memory is as large as the file.
  bytes.resize_and_overwrite(file->size, [&](char* to, std::size_t count) {
    status = read_all(path, *file, to);
    return status ? count : 0;
  });
  if (!status) {
    return std::unexpected(status.error());
  }
  return bytes;
}

FileBlock::FileBlock(std::size_t size)
    : floats_(shared_block<float>((size + sizeof(float) - 1) / sizeof(float))), size_(size) {}

FileBlock::FileBlock(std::string_view bytes) : FileBlock(bytes.size()) {
  std::ranges::copy(bytes, data());
}

Result<FileBlock> read_file_block(const fs::path& path) {
  auto file = open_file(path);
  if (!file) {
    return std::unexpected(file.error());
  }
  FileBlock block(file->size);
  if (Status status = read_all(path, *file, block.data()); !status) {
    return std::unexpected(status.error());
  }
  return block;
}

Status write_file(const fs::path& path, std::string_view bytes) {
  std::error_code error;
  // A device or a pipe (/dev/stdout) is written to, never replaced.
  const bool replace = !fs::exists(path, error) || fs::is_regular_file(path, error);
  fs::path partial = path;
  if (replace) {
    partial += ".partial";
  }
  if (fs::is_directory(path, error)) {
    return cannot(ErrorCode::kInvalidArgument, path, "is a folder, expected a file", "name a file inside it");
  }
  errno = 0;
  std::ofstream out(partial, std::ios::binary | std::ios::trunc);
  if (!out) {
    return stream_error(path, "write it");
  }
  out.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  out.close();
  if (!out) {
    auto failed = stream_error(path, "write it");
    if (replace) {
      fs::remove(partial, error);
    }
    return failed;
  }
  if (!replace) {
    return {};
  }
  fs::rename(partial, path, error);
  if (error) {
    const std::string what = fmt::format("cannot replace it: {}", error.message());
    fs::remove(partial, error);
    return cannot(ErrorCode::kPermissionDenied, path, what, "check the permissions of the folder");
  }
  return {};
}

}  // namespace scatter::formats
