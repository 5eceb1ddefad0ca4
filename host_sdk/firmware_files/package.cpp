#include "host_sdk/firmware_files/package.h"

#include <fmt/format.h>
#include <sodium.h>

#include <algorithm>
#include <optional>

#include "host_sdk/firmware_files/dfu_suffix.h"
#include "host_sdk/firmware_files/file_bytes.h"
#include "protocol/codec.h"
#include "protocol/crc.h"
#include "protocol/endian.h"

namespace scatter::firmware_files {
namespace {

using protocol::ImageHeader;
using protocol::ImageText;
using protocol::load_le;
using protocol::store_le;

/// The file's header; README.md has the table.
constexpr std::uint32_t kMagic = 0x57464353;  // "SCFW"
constexpr std::uint16_t kVersion = 1;
constexpr std::size_t kMagicAt = 0;
constexpr std::size_t kVersionAt = 4;
constexpr std::size_t kCountAt = 6;
constexpr std::size_t kTotalAt = 8;
constexpr std::size_t kRowsAt = 16;
constexpr std::size_t kRowBytes = 8;
constexpr std::size_t kChecksumAt = 60;
constexpr std::size_t kFileHeaderBytes = 64;
constexpr std::size_t kAlignment = 64;
constexpr std::size_t kMaxFileBytes =
    kFileHeaderBytes + kImages * (protocol::kImageHeaderBytes + kMaxBodyBytes + kAlignment) + kDfuSuffixBytes;

constexpr std::size_t aligned(std::size_t offset) {
  return (offset + kAlignment - 1) / kAlignment * kAlignment;
}

std::optional<std::string_view> text_of(const ImageText& text) {
  const auto end = std::ranges::find(text, 0);
  const bool good = end != text.begin() &&
                    std::all_of(text.begin(), end, [](std::uint8_t c) { return c >= 0x20 && c < 0x7F; }) &&
                    std::all_of(end, text.end(), [](std::uint8_t c) { return c == 0; });
  if (!good) {
    return std::nullopt;
  }
  return std::string_view(reinterpret_cast<const char*>(text.data()),
                          static_cast<std::size_t>(end - text.begin()));
}

/// The file's header as it must be for images of these sizes.
std::array<std::byte, kFileHeaderBytes> file_header(const std::array<std::size_t, kImages>& image_bytes) {
  std::array<std::byte, kFileHeaderBytes> out{};
  store_le(out.data() + kMagicAt, kMagic);
  store_le(out.data() + kVersionAt, kVersion);
  store_le(out.data() + kCountAt, static_cast<std::uint16_t>(kImages));
  std::size_t at = kFileHeaderBytes;
  for (std::size_t k = 0; k < kImages; ++k) {
    at = aligned(at);
    store_le(out.data() + kRowsAt + k * kRowBytes, static_cast<std::uint32_t>(at));
    store_le(out.data() + kRowsAt + k * kRowBytes + 4, static_cast<std::uint32_t>(image_bytes[k]));
    at += image_bytes[k];
  }
  store_le(out.data() + kTotalAt, static_cast<std::uint32_t>(at));
  store_le(out.data() + kChecksumAt, protocol::crc32c(std::span(out).first(kChecksumAt)));
  return out;
}

/// Reads one file and says where it is wrong.
class Parser {
 public:
  Parser(std::span<const std::byte> bytes, std::string_view file) : bytes_(bytes), file_(file) {}

  Result<std::array<Image, kImages>> parse() {
    if (const Status header = check_header(); !header) {
      return std::unexpected(header.error());
    }
    std::array<Image, kImages> images;
    std::size_t end = kFileHeaderBytes;
    for (std::size_t slot = 0; slot < kImages; ++slot) {
      const auto at = load_le<std::uint32_t>(bytes_.data() + kRowsAt + slot * kRowBytes);
      const auto size = load_le<std::uint32_t>(bytes_.data() + kRowsAt + slot * kRowBytes + 4);
      for (std::size_t k = end; k < at; ++k) {
        if (bytes_[k] != std::byte{0}) {
          return damaged(k, "padding", "0", fmt::format("{:02x}", static_cast<unsigned>(bytes_[k])));
        }
      }
      end = at + size;
      auto image = read_image(slot, at, size);
      if (!image) {
        return std::unexpected(image.error());
      }
      images[slot] = std::move(*image);
    }
    if (const Status same = check_pair(images); !same) {
      return std::unexpected(same.error());
    }
    return images;
  }

 private:
  [[nodiscard]] std::unexpected<Error> damaged(std::size_t at, std::string_view what,
                                               std::string_view expected, std::string_view found) const {
    return fail(ErrorCode::kDataLoss,
                fmt::format("{}: offset {}: {} is {} when it should be {}", file_, at, what, found, expected),
                "download or build the file again");
  }
  [[nodiscard]] std::unexpected<Error> refused(std::string why, std::string remedy) const {
    return fail(ErrorCode::kInvalidArgument, fmt::format("{}: {}", file_, why), std::move(remedy));
  }

  Status check_header() {
    if (bytes_.size() < 4 || load_le<std::uint32_t>(bytes_.data()) != kMagic) {
      return refused("does not begin with SCFW, so it is no firmware file",
                     "name a .scfw or .dfu file; scatter firmware sign makes them");
    }
    if (bytes_.size() < kFileHeaderBytes) {
      return damaged(bytes_.size(), "the file's end", fmt::format("at {} or later", kFileHeaderBytes),
                     "here");
    }
    const auto version = load_le<std::uint16_t>(bytes_.data() + kVersionAt);
    const auto checksum = load_le<std::uint32_t>(bytes_.data() + kChecksumAt);
    const auto expected = protocol::crc32c(bytes_.first(kChecksumAt));
    if (checksum != expected) {
      return damaged(kChecksumAt, "the header's checksum", fmt::format("{:08x}", expected),
                     fmt::format("{:08x}", checksum));
    }
    if (version != kVersion) {
      return refused(fmt::format("container version {}, this program reads {}", version, kVersion),
                     "update the host's software");
    }
    // Exactly one header is right for images of these sizes.
    std::array<std::size_t, kImages> sizes{};
    for (std::size_t k = 0; k < kImages; ++k) {
      const std::size_t place = kRowsAt + k * kRowBytes + 4;
      sizes[k] = load_le<std::uint32_t>(bytes_.data() + place);
      if (sizes[k] <= protocol::kImageHeaderBytes || sizes[k] > protocol::kImageHeaderBytes + kMaxBodyBytes) {
        return damaged(place, fmt::format("the size of image {}", k),
                       fmt::format("{} to {}", protocol::kImageHeaderBytes + 1,
                                   protocol::kImageHeaderBytes + kMaxBodyBytes),
                       std::to_string(sizes[k]));
      }
    }
    const auto right = file_header(sizes);
    for (std::size_t k = 0; k < kChecksumAt; k += 2) {
      const auto want = load_le<std::uint16_t>(right.data() + k);
      const auto have = load_le<std::uint16_t>(bytes_.data() + k);
      if (want != have) {
        return damaged(k, "a half-word of the header", fmt::format("{:04x}", want),
                       fmt::format("{:04x}", have));
      }
    }
    const auto total = load_le<std::uint32_t>(right.data() + kTotalAt);
    if (bytes_.size() != total) {
      return damaged(bytes_.size(), "the file's size", std::to_string(total), std::to_string(bytes_.size()));
    }
    return {};
  }

  Result<Image> read_image(std::size_t slot, std::size_t at, std::size_t size) {
    const auto header = protocol::decode<ImageHeader>(bytes_.subspan(at, protocol::kImageHeaderBytes));
    if (!header || header->magic != protocol::kImageMagic) {
      return damaged(at, fmt::format("the magic of image {}", slot), "OSFW", "another");
    }
    if (header->header_version != protocol::kImageHeaderVersion ||
        (header->flags & ~unsigned{protocol::kImageSignedForTest}) != 0) {
      return refused(
          fmt::format("image {}: header version {} with flags {:04x}, this program knows 1 and 0001", slot,
                      header->header_version, header->flags),
          "update the host's software");
    }
    constexpr std::size_t kZero1At = 77;
    constexpr std::size_t kZero2At = 160;
    const auto zero = [](std::uint8_t b) { return b == 0; };
    if (!std::ranges::all_of(header->zero_1, zero) || !std::ranges::all_of(header->zero_2, zero)) {
      const bool first = !std::ranges::all_of(header->zero_1, zero);
      return damaged(at + (first ? kZero1At : kZero2At), "a reserved byte", "0", "another");
    }
    constexpr std::size_t kSlotAt = 76;
    if (header->slot != slot) {
      return damaged(at + kSlotAt, fmt::format("the slot of image {}", slot), std::to_string(slot),
                     std::to_string(header->slot));
    }
    constexpr std::size_t kProductAt = 8;
    constexpr std::size_t kVersionTextAt = 40;
    if (!text_of(header->product) || !text_of(header->version)) {
      const bool product = !text_of(header->product);
      return damaged(at + (product ? kProductAt : kVersionTextAt), product ? "the product" : "the version",
                     "printable text", "another");
    }
    constexpr std::size_t kBodyBytesAt = 84;
    if (header->body_bytes != size - protocol::kImageHeaderBytes) {
      return damaged(at + kBodyBytesAt, fmt::format("the body's size in image {}", slot),
                     std::to_string(size - protocol::kImageHeaderBytes), std::to_string(header->body_bytes));
    }
    const auto body = bytes_.subspan(at + protocol::kImageHeaderBytes, header->body_bytes);
    protocol::Sha512 hash{};
    crypto_hash_sha512(hash.data(), reinterpret_cast<const unsigned char*>(body.data()), body.size());
    if (hash != header->body_sha512) {
      return damaged(at + protocol::kImageHeaderBytes, fmt::format("the SHA-512 of image {}'s body", slot),
                     hex(header->body_sha512), hex(hash));
    }
    return Image{.header = *header, .body = {body.begin(), body.end()}};
  }

  /// The beginning says enough.
  static std::string hex(const protocol::Sha512& hash) {
    return fmt::format("{:02x}{:02x}{:02x}{:02x}...", hash[0], hash[1], hash[2], hash[3]);
  }

  Status check_pair(const std::array<Image, kImages>& images) const {
    const ImageHeader& a = images[0].header;
    const ImageHeader& b = images[1].header;
    const char* differs = a.product != b.product                     ? "products"
                          : a.version != b.version                   ? "versions"
                          : a.security_counter != b.security_counter ? "security counters"
                          : a.flags != b.flags                       ? "flags"
                          : a.key_id != b.key_id                     ? "keys"
                                                                     : nullptr;
    if (differs != nullptr) {
      return fail(ErrorCode::kDataLoss,
                  fmt::format("{}: images 0 and 1 have different {}, expected the same", file_, differs),
                  "build the file again; both images must come from one release");
    }
    return {};
  }

  std::span<const std::byte> bytes_;
  std::string_view file_;
};

}  // namespace

HeaderBytes header_bytes(const ImageHeader& header) noexcept {
  static_assert(protocol::max_encoded_size<ImageHeader>() == protocol::kImageHeaderBytes);
  HeaderBytes out{};
  (void)protocol::encode(header, std::as_writable_bytes(std::span(out)));
  return out;
}

Result<Package> Package::parse(std::span<const std::byte> bytes, std::string_view file) {
  // The file says how long it is, so a body that happens to end like a suffix misleads nobody.
  const bool has_header = bytes.size() >= kFileHeaderBytes && load_le<std::uint32_t>(bytes.data()) == kMagic;
  const std::size_t total = has_header ? load_le<std::uint32_t>(bytes.data() + kTotalAt) : 0;
  if (has_header && bytes.size() - kFileHeaderBytes >= kDfuSuffixBytes &&
      bytes.size() == total + kDfuSuffixBytes) {
    const auto contents = strip_dfu_suffix(bytes, file);
    if (!contents) {
      return std::unexpected(contents.error());
    }
    bytes = *contents;
  }
  auto images = Parser(bytes, file).parse();
  if (!images) {
    return std::unexpected(std::move(images.error()));
  }
  return Package(std::move(*images));
}

Result<Package> Package::load(const std::filesystem::path& file) {
  const auto bytes = read_file(file, kMaxFileBytes);
  if (!bytes) {
    return std::unexpected(bytes.error());
  }
  return parse(*bytes, file.string());
}

std::string Package::product() const {
  return std::string(text_of(images_[0].header.product).value_or(""));
}

std::string Package::version() const {
  return std::string(text_of(images_[0].header.version).value_or(""));
}

std::vector<std::byte> Package::bytes() const {
  std::array<std::size_t, kImages> sizes{};
  for (std::size_t k = 0; k < kImages; ++k) {
    sizes[k] = protocol::kImageHeaderBytes + images_[k].body.size();
  }
  const auto header = file_header(sizes);
  std::vector<std::byte> out(header.begin(), header.end());
  for (const Image& image : images_) {
    out.resize(aligned(out.size()));
    const HeaderBytes head = header_bytes(image.header);
    const auto head_bytes = std::as_bytes(std::span(head));
    out.insert(out.end(), head_bytes.begin(), head_bytes.end());
    out.insert(out.end(), image.body.begin(), image.body.end());
  }
  return out;
}

}  // namespace scatter::firmware_files
