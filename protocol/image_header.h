// The signed header of a firmware image: what a bootloader checks before it starts an image, and what a
// device checks before it erases a slot for one.
//
// A slot holds: header (256 bytes, at 0), erased bytes up to kImageBodyOffset, the body (a vector table
// first, linked to run from there), and in its last erase unit the marks of firmware/image.
//
//   offset size
//        0    4 magic "OSFW"
//        4    2 header version 1
//        6    2 flags: bit 0 = signed with a test key
//        8   32 product, zero padded: must be the descriptor's
//       40   32 version, zero padded
//       72    4 security counter: never falls below that of the confirmed image
//       76    1 slot that the body is linked for, 0 or 1
//       77    3 zero
//       80    4 address that the body is linked for
//       84    4 bytes of the body
//       88   64 SHA-512 of the body
//      152    8 key id: first 8 bytes of the SHA-512 of the Ed25519 public key
//      160   32 zero
//      192   64 Ed25519 signature (RFC 8032) of bytes 0..191
// All little endian.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "protocol/field.h"

namespace scatter::protocol {

inline constexpr std::size_t kImageHeaderBytes = 256;
inline constexpr std::size_t kSignedHeaderBytes = 192;
/// Where the body begins in a slot; aligned for any vector table of a Cortex-M.
inline constexpr std::uint32_t kImageBodyOffset = 1024;
inline constexpr std::uint32_t kImageMagic = 0x5746534F;  // "OSFW"
inline constexpr std::uint16_t kImageHeaderVersion = 1;

enum ImageFlag : std::uint16_t { kImageSignedForTest = 1U << 0U };

using ImageText = std::array<std::uint8_t, 32>;
using Sha512 = std::array<std::uint8_t, 64>;
using KeyId = std::array<std::uint8_t, 8>;
using Signature = std::array<std::uint8_t, 64>;
using PublicKey = std::array<std::uint8_t, 32>;

/// Encoded and decoded by codec.h; the encoding is exactly kImageHeaderBytes long.
struct ImageHeader {
  std::uint32_t magic = kImageMagic;
  std::uint16_t header_version = kImageHeaderVersion;
  std::uint16_t flags = 0;
  ImageText product{};
  ImageText version{};
  std::uint32_t security_counter = 0;
  std::uint8_t slot = 0;
  std::array<std::uint8_t, 3> zero_1{};
  std::uint32_t load_address = 0;
  std::uint32_t body_bytes = 0;
  Sha512 body_sha512{};
  KeyId key_id{};
  std::array<std::uint8_t, 32> zero_2{};
  Signature signature{};
  static constexpr auto schema() {
    using H = ImageHeader;
    return fields(
        field("magic", &H::magic, "", "\"OSFW\""), field("header_version", &H::header_version, "", "1"),
        field("flags", &H::flags, "", "bit 0: signed with a test key"),
        field("product", &H::product, "", "zero padded"), field("version", &H::version, "", "zero padded"),
        field("security_counter", &H::security_counter, "", "rises with security fixes"),
        field("slot", &H::slot, "", "0 or 1"), field("zero_1", &H::zero_1, "", "0"),
        field("load_address", &H::load_address, "", "where the body runs"),
        field("body_bytes", &H::body_bytes, "B", "size of the body"),
        field("body_sha512", &H::body_sha512, "", "of the body"),
        field("key_id", &H::key_id, "", "who signed"), field("zero_2", &H::zero_2, "", "0"),
        field("signature", &H::signature, "", "Ed25519 of bytes 0..191"));
  }
  friend constexpr bool operator==(const ImageHeader&, const ImageHeader&) noexcept = default;
};

}  // namespace scatter::protocol
