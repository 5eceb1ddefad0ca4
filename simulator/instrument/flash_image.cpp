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

constexpr std::size_t bytes_of(const firmware::Flash::Geometry& geometry) noexcept {
  return std::size_t{geometry.unit_bytes} * geometry.units;
}

constexpr std::size_t kOldBytes = bytes_of(FlashImage::kGeometry);
constexpr std::size_t kSlotBytes = bytes_of(FlashImage::kSlotGeometry);
constexpr std::size_t kBytes = kOldBytes + 2 * kSlotBytes;

bool inside(const firmware::Flash::Geometry& geometry, std::uint32_t offset, std::size_t length) noexcept {
  const std::size_t size = bytes_of(geometry);
  return offset <= size && length <= size - offset;
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
  if (size != kBytes && size != kOldBytes) {
    return fail(ErrorCode::kDataLoss,
                fmt::format("flash image {} has {} bytes, expected {} (or {} of an older simulator)",
                            file.string(), size, kBytes, kOldBytes),
                "name a flash image of this simulator, or a new file");
  }
  if (::pread(image->file_, image->cells_.data(), size, 0) != static_cast<ssize_t>(size) ||
      (size < kBytes && !image->store(size, kBytes - size))) {
    return fail(ErrorCode::kDataLoss, fmt::format("flash image {}: {}", file.string(), std::strerror(errno)),
                "choose another file");
  }
  return image;
}

bool FlashImage::store(std::size_t offset, std::size_t length) noexcept {
  return file_ < 0 || ::pwrite(file_, cells_.data() + offset, length, static_cast<off_t>(offset)) ==
                          static_cast<ssize_t>(length);
}

FlashImage::Region FlashImage::slot_region(std::uint8_t index) noexcept {
  return {.base = kOldBytes + index * kSlotBytes, .geometry = kSlotGeometry};
}

bool FlashImage::slots_are_blank() const noexcept {
  return std::all_of(cells_.begin() + kOldBytes, cells_.end(),
                     [](std::byte cell) { return cell == kErased; });
}

bool FlashImage::read(std::uint32_t offset, std::span<std::byte> out) noexcept {
  return read_in({.base = 0, .geometry = kGeometry}, offset, out);
}
bool FlashImage::program(std::uint32_t offset, std::span<const std::byte> bytes) noexcept {
  return program_in({.base = 0, .geometry = kGeometry}, offset, bytes);
}
bool FlashImage::erase(std::uint32_t unit) noexcept {
  return erase_in({.base = 0, .geometry = kGeometry}, unit);
}

bool FlashImage::read_in(const Region& region, std::uint32_t offset, std::span<std::byte> out) noexcept {
  if (!inside(region.geometry, offset, out.size())) {
    ++violations_;
    return false;
  }
  std::copy_n(cells_.begin() + static_cast<std::ptrdiff_t>(region.base + offset), out.size(), out.begin());
  return true;
}

bool FlashImage::program_in(const Region& region, std::uint32_t offset,
                            std::span<const std::byte> bytes) noexcept {
  const std::uint32_t granule = region.geometry.program_bytes;
  const bool aligned = offset % granule == 0 && bytes.size() % granule == 0;
  const std::size_t place = region.base + offset;
  if (!inside(region.geometry, offset, bytes.size()) || !aligned ||
      !std::ranges::all_of(std::span(cells_).subspan(place, bytes.size()),
                           [](std::byte cell) { return cell == kErased; })) {
    ++violations_;
    return false;
  }
  std::ranges::copy(bytes, cells_.begin() + static_cast<std::ptrdiff_t>(place));
  return store(place, bytes.size());
}

bool FlashImage::erase_in(const Region& region, std::uint32_t unit) noexcept {
  if (unit >= region.geometry.units) {
    ++violations_;
    return false;
  }
  const std::size_t offset = region.base + std::size_t{unit} * region.geometry.unit_bytes;
  std::fill_n(cells_.begin() + static_cast<std::ptrdiff_t>(offset), region.geometry.unit_bytes, kErased);
  return store(offset, region.geometry.unit_bytes);
}

}  // namespace scatter::simulator
