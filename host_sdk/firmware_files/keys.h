// Ed25519 keys that sign firmware images, and the text files that hold them.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

#include "host_sdk/error/error.h"
#include "protocol/image_header.h"

namespace scatter::firmware_files {

/// The public half of the key in firmware/keys, which everybody has: for development and simulators only.
inline constexpr protocol::PublicKey kTestPublicKey = {
    0x79, 0x32, 0x52, 0x97, 0xA6, 0x94, 0x60, 0x28, 0x7F, 0xEA, 0x15, 0x07, 0xC9, 0x34, 0x17, 0xB9,
    0xAA, 0xB0, 0xB0, 0x10, 0x68, 0xFF, 0xBF, 0xF2, 0x09, 0x1C, 0xD8, 0xCF, 0x65, 0xE5, 0x1D, 0xF3};

/// Seed of a key pair (RFC 8032). Wiped when it goes away.
class SecretKey {
 public:
  using Seed = std::array<std::uint8_t, 32>;
  explicit SecretKey(const Seed& seed) noexcept : seed_(seed) {}
  SecretKey(const SecretKey&) = default;
  SecretKey& operator=(const SecretKey&) = default;
  ~SecretKey();

  [[nodiscard]] const Seed& seed() const noexcept { return seed_; }
  [[nodiscard]] protocol::PublicKey public_key() const;

 private:
  Seed seed_;
};

/// First 8 bytes of the SHA-512 of the public key.
[[nodiscard]] protocol::KeyId key_id(const protocol::PublicKey& key);
/// 16 hexadecimal digits.
[[nodiscard]] std::string text(const protocol::KeyId& id);

/// The contents of a key file. A last line end may be missing, and lines may end in CR LF; nothing else may
/// differ. `file` names it in messages.
/// Errors  kInvalidArgument: the other kind of key, or no key; kDataLoss: not 64 hexadecimal digits.
[[nodiscard]] Result<SecretKey> parse_secret_key(std::string_view contents, std::string_view file);
[[nodiscard]] Result<protocol::PublicKey> parse_public_key(std::string_view contents, std::string_view file);

/// Errors  kNotFound, kPermissionDenied, kUnavailable (cannot be read), and those of parsing.
[[nodiscard]] Result<SecretKey> load_secret_key(const std::filesystem::path& file);
[[nodiscard]] Result<protocol::PublicKey> load_public_key(const std::filesystem::path& file);

struct KeyFiles {
  std::filesystem::path secret;  ///< NAME.key, mode 0600.
  std::filesystem::path open;    ///< NAME.pub
  protocol::PublicKey key{};
};

/// Makes a new key pair (libsodium's random numbers) and writes NAME.key and NAME.pub.
/// Errors  kFailedPrecondition: one of them exists (keys are never overwritten); kPermissionDenied, kNotFound
///         (folder), kResourceExhausted. After an error neither file is there.
[[nodiscard]] Result<KeyFiles> generate_keys(const std::filesystem::path& name);

}  // namespace scatter::firmware_files
