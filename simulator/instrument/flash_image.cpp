#include "simulator/instrument/flash_image.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include <fmt/format.h>

namespace scatter::simulator {
namespace {

constexpr std::byte kErased{0xFF};
constexpr std::size_t kBytes =
    std::size_t{FlashImage::kGeometry.unit_bytes} * std::size_t{FlashImage::kGeometry.units};

bool inside(std::uint32_t offset, std::size_t length) noexcept {
  return offset <= kBytes && length <= kBytes - offset;
}

}  // namespace

FlashImage::FlashImage() : cells_(kBytes, kErased) {}

FlashImage::~FlashImage() {
  if (file_ >= 0) {
    ::close(file_);
  }
}

Result<std::unique_ptr<FlashImage>> FlashImage::open(const std::filesystem::path& file) {
  auto image = std::make_unique<FlashImage>();
  image->file_ = ::open(file.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644);
  if (image->file_ < 0) {
    return fail(ErrorCode::kPermissionDenied,
                fmt::format("flash image {}: {}", file.string(), std::strerror(errno)),
                "choose a file in a folder that you may write to");
  }
  struct stat info{};
  if (::fstat(image->file_, &info) != 0) {
    return fail(ErrorCode::kDataLoss, fmt::format("flash image {}: {}", file.string(), std::strerror(errno)),
                "choose another file");
  }
  const auto size = static_cast<std::size_t>(info.st_size);
  if (size == 0) {
    if (!image->store(0, kBytes)) {
      return fail(ErrorCode::kResourceExhausted,
                  fmt::format("flash image {}: {}", file.string(), std::strerror(errno)),
                  "free some space on that disk");
    }
    return image;
  }
  if (size != kBytes) {
    return fail(ErrorCode::kDataLoss,
                fmt::format("flash image {} has {} bytes, expected {}", file.string(), size, kBytes),
                "name a flash image of this simulator, or a new file");
  }
  if (::pread(image->file_, image->cells_.data(), kBytes, 0) != static_cast<ssize_t>(kBytes)) {
    return fail(ErrorCode::kDataLoss, fmt::format("flash image {}: {}", file.string(), std::strerror(errno)),
                "choose another file");
  }
  return image;
}

bool FlashImage::store(std::size_t offset, std::size_t length) noexcept {
  return file_ < 0 || ::pwrite(file_, cells_.data() + offset, length, static_cast<off_t>(offset)) ==
                          static_cast<ssize_t>(length);
}

bool FlashImage::read(std::uint32_t offset, std::span<std::byte> out) noexcept {
  if (!inside(offset, out.size())) {
    ++violations_;
    return false;
  }
  std::copy_n(cells_.begin() + offset, out.size(), out.begin());
  return true;
}

bool FlashImage::program(std::uint32_t offset, std::span<const std::byte> bytes) noexcept {
  const bool aligned = offset % kGeometry.program_bytes == 0 && bytes.size() % kGeometry.program_bytes == 0;
  if (!inside(offset, bytes.size()) || !aligned ||
      !std::all_of(cells_.begin() + offset,
                   cells_.begin() + offset + static_cast<std::ptrdiff_t>(bytes.size()),
                   [](std::byte cell) { return cell == kErased; })) {
    ++violations_;
    return false;
  }
  std::ranges::copy(bytes, cells_.begin() + offset);
  return store(offset, bytes.size());
}

bool FlashImage::erase(std::uint32_t unit) noexcept {
  if (unit >= kGeometry.units) {
    ++violations_;
    return false;
  }
  const std::size_t offset = std::size_t{unit} * kGeometry.unit_bytes;
  std::fill_n(cells_.begin() + static_cast<std::ptrdiff_t>(offset), kGeometry.unit_bytes, kErased);
  return store(offset, kGeometry.unit_bytes);
}

}  // namespace scatter::simulator
