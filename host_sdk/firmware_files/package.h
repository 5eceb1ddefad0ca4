// A release of firmware for one product: both linkings, each with its signed header (`.scfw`, README.md).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "host_sdk/error/error.h"
#include "protocol/image_header.h"

namespace scatter::firmware_files {

inline constexpr std::uint32_t kMaxBodyBytes = 16U << 20U;
inline constexpr std::size_t kImages = 2;

/// The header as a slot holds it.
using HeaderBytes = std::array<std::uint8_t, protocol::kImageHeaderBytes>;
[[nodiscard]] HeaderBytes header_bytes(const protocol::ImageHeader& header) noexcept;

/// One linking.
struct Image {
  protocol::ImageHeader header;
  std::vector<std::byte> body;
};

class SecretKey;
struct Release;

/// Both linkings of one release. An object exists only when every rule of README.md holds; whether somebody
/// trusted signed it is for verify() to say.
/// Threads  const: any.
class Package {
 public:
  /// A `.scfw`, or a `.dfu` around one. `file` names it in messages.
  /// Errors  kInvalidArgument: no such file, or a later version; kDataLoss: damaged or truncated. The message
  ///         names the offset, what was expected and what was found.
  [[nodiscard]] static Result<Package> parse(std::span<const std::byte> bytes, std::string_view file);
  /// Errors  kNotFound, kPermissionDenied, kUnavailable; as parse().
  [[nodiscard]] static Result<Package> load(const std::filesystem::path& file);

  /// `slot` is 0 or 1.
  [[nodiscard]] const Image& image(std::size_t slot) const noexcept { return images_[slot]; }
  [[nodiscard]] std::string product() const;
  [[nodiscard]] std::string version() const;
  [[nodiscard]] std::uint32_t security_counter() const noexcept { return images_[0].header.security_counter; }
  [[nodiscard]] const protocol::KeyId& key() const noexcept { return images_[0].header.key_id; }
  /// It says that a test key signed it.
  [[nodiscard]] bool for_test() const noexcept {
    return (images_[0].header.flags & protocol::kImageSignedForTest) != 0;
  }

  /// The file. parse(bytes()) gives the same package, and there is no other file that does.
  [[nodiscard]] std::vector<std::byte> bytes() const;

 private:
  friend Result<Package> sign(const Release& release, const SecretKey& key);
  explicit Package(std::array<Image, kImages> images) noexcept : images_(std::move(images)) {}
  std::array<Image, kImages> images_;
};

}  // namespace scatter::firmware_files
