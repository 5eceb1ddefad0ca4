#include "host_sdk/device/usb/system_tables.h"

#include <dirent.h>
#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <climits>
#include <memory>

namespace scatter::device::usb {
namespace {

constexpr std::size_t kLongestAttribute = 256;

bool plain(char c) noexcept {
  const auto byte = static_cast<unsigned char>(c);
  return byte >= 0x20 && byte != 0x7F;
}

}  // namespace

std::vector<std::byte> file_bytes(const std::filesystem::path& path, std::size_t most) {
  std::vector<std::byte> out;
  const int file = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NOCTTY);
  if (file < 0) {
    return out;
  }
  std::array<std::byte, 4096> piece;
  while (out.size() < most) {
    const ssize_t got = ::read(file, piece.data(), std::min(piece.size(), most - out.size()));
    if (got < 0 && errno == EINTR) {
      continue;
    }
    if (got <= 0) {
      break;
    }
    out.insert(out.end(), piece.begin(), piece.begin() + got);
  }
  ::close(file);
  return out;
}

std::string attribute(const std::filesystem::path& path) {
  std::string out;
  for (const std::byte byte : file_bytes(path, kLongestAttribute)) {
    out.push_back(static_cast<char>(byte));
  }
  while (!out.empty() && (out.back() == '\n' || out.back() == '\0' || out.back() == ' ')) {
    out.pop_back();
  }
  std::ranges::replace_if(out, [](char c) { return !plain(c); }, '?');
  return out;
}

std::vector<std::string> names_in(const std::filesystem::path& folder) {
  std::vector<std::string> out;
  const std::unique_ptr<DIR, int (*)(DIR*)> open(::opendir(folder.c_str()),
                                                 [](DIR* one) { return ::closedir(one); });
  if (open == nullptr) {
    return out;
  }
  while (const dirent* entry = ::readdir(open.get())) {
    const std::string_view name = entry->d_name;
    if (name != "." && name != "..") {
      out.emplace_back(name);
    }
  }
  std::ranges::sort(out);
  return out;
}

std::string link_target(const std::filesystem::path& link) {
  std::array<char, PATH_MAX> target;
  const ssize_t size = ::readlink(link.c_str(), target.data(), target.size());
  return size < 0 ? std::string() : std::string(target.data(), static_cast<std::size_t>(size));
}

std::optional<std::uint32_t> number(std::string_view text, int base) noexcept {
  std::uint32_t out = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), out, base);
  return error == std::errc() && end == text.data() + text.size() && !text.empty() ? std::optional(out)
                                                                                   : std::nullopt;
}

}  // namespace scatter::device::usb
