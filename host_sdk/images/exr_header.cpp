#include "host_sdk/images/exr_header.h"

#include <fmt/format.h>

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>
#include <string>

namespace scatter::images {
namespace {

using namespace std::string_view_literals;

constexpr std::size_t kLongestName = 255;
constexpr std::uint32_t kTiled = 0x200;
constexpr std::uint32_t kDeep = 0x800;
constexpr std::uint32_t kMultiPart = 0x1000;
/// Deflate, the best packer among EXR's lossless ones, reaches 1032 : 1; a pixel has 2 bytes.
constexpr double kLeastBytesPerPixel = 2.0 / 1032;

class Walker {
 public:
  Walker(std::string_view bytes, std::string_view name) : bytes_(bytes), name_(name) {}

  Status walk() {
    if (!bytes_.starts_with("\x76\x2f\x31\x01"sv) || bytes_.size() < 8) {
      return bad("expected the OpenEXR magic number and version");
    }
    at_ = 4;
    const std::uint32_t flags = take_u32();
    if ((flags & (kTiled | kDeep)) != 0) {
      return fail(ErrorCode::kUnimplemented, fmt::format("{}: is a tiled or deep OpenEXR image", name_),
                  "save it as a flat scan line image");
    }
    const bool multi_part = (flags & kMultiPart) != 0;
    do {
      if (Status status = header(); !status) {
        return status;
      }
    } while (multi_part && at_ < bytes_.size() && bytes_[at_] != '\0');
    return {};
  }

 private:
  [[nodiscard]] std::unexpected<Error> bad(std::string_view what) const {
    return fail(ErrorCode::kDataLoss, fmt::format("{}: byte {}: {}", name_, at_, what),
                "the file is damaged or incomplete: export it again");
  }

  std::uint32_t take_u32() {
    std::uint32_t value = 0;
    for (std::size_t k = 4; k-- > 0;) {
      value = value << 8 | static_cast<unsigned char>(bytes_[at_ + k]);
    }
    at_ += 4;
    return value;
  }

  /// A name up to its zero byte.
  std::optional<std::string_view> take_name() {
    const std::size_t end = bytes_.find('\0', at_);
    if (end == std::string_view::npos || end - at_ > kLongestName) {
      return std::nullopt;
    }
    const std::string_view word = bytes_.substr(at_, end - at_);
    at_ = end + 1;
    return word;
  }

  Status header() {
    while (true) {
      const auto attribute = take_name();
      if (!attribute) {
        return bad("expected an attribute's name");
      }
      if (attribute->empty()) {
        return {};
      }
      const auto type = take_name();
      if (!type || bytes_.size() - at_ < 4) {
        return bad(fmt::format("expected type and size of attribute '{}'", printable(*attribute)));
      }
      const std::uint32_t size = take_u32();
      if (size > bytes_.size() - at_) {
        return bad(fmt::format("attribute '{}' has {} bytes, but only {} follow", printable(*attribute), size,
                               bytes_.size() - at_));
      }
      const std::size_t end = at_ + size;
      if (Status status = check(*attribute, *type, size); !status) {
        return status;
      }
      at_ = end;
    }
  }

  Status check(std::string_view attribute, std::string_view type, std::uint32_t size) {
    if ((attribute == "dataWindow" || attribute == "displayWindow") && size == 16) {
      const auto x_min = static_cast<std::int32_t>(take_u32());
      const auto y_min = static_cast<std::int32_t>(take_u32());
      const auto x_max = static_cast<std::int32_t>(take_u32());
      const auto y_max = static_cast<std::int32_t>(take_u32());
      const double width = static_cast<double>(x_max) - x_min + 1;
      const double height = static_cast<double>(y_max) - y_min + 1;
      if (!(width >= 1 && height >= 1) ||
          width * height * kLeastBytesPerPixel > static_cast<double>(bytes_.size())) {
        return bad(fmt::format("an image of {} x {} pixels in {} bytes", width, height, bytes_.size()));
      }
    }
    if (attribute == "chunkCount" && size == 4) {
      if (const std::uint32_t chunks = take_u32(); chunks > bytes_.size() / 8) {
        return bad(fmt::format("{} chunks in {} bytes", chunks, bytes_.size()));
      }
    }
    if (type == "string" && attribute == "type" && bytes_.substr(at_, size) != "scanlineimage") {
      return fail(ErrorCode::kUnimplemented, fmt::format("{}: has a part that is no scan line image", name_),
                  "save it as flat scan line images");
    }
    // These types state a size of their own inside; none of them belongs into our files.
    if (type == "preview" || type == "idmanifest") {
      return fail(ErrorCode::kUnimplemented, fmt::format("{}: has an attribute of type {}", name_, type),
                  "save it without preview image and manifest");
    }
    return {};
  }

  static std::string printable(std::string_view text) {
    std::string out;
    for (const char c : text.substr(0, 40)) {
      out += c >= ' ' && c <= '~' ? c : '?';
    }
    return out;
  }

  std::string_view bytes_;
  std::string_view name_;
  std::size_t at_ = 0;
};

}  // namespace

Status check_exr_header(std::string_view bytes, std::string_view name) {
  return Walker(bytes, name).walk();
}

}  // namespace scatter::images
