#include "host_sdk/firmware_files/signing.h"

#include <fmt/format.h>
#include <sodium.h>

#include <algorithm>
#include <utility>

#include "protocol/endian.h"

namespace scatter::firmware_files {
namespace {

using protocol::ImageHeader;
using protocol::load_le;

constexpr std::size_t kTextBytes = std::tuple_size_v<protocol::ImageText>;

Status check_text(std::string_view name, std::string_view text) {
  const bool printable = std::ranges::all_of(text, [](char c) { return c >= 0x20 && c < 0x7F; });
  if (text.empty() || text.size() > kTextBytes || !printable) {
    return fail(ErrorCode::kInvalidArgument,
                fmt::format("the {} has {} characters, expected 1 to {} printable ones (ASCII)", name,
                            text.size(), kTextBytes),
                fmt::format("give another --{}", name));
  }
  return {};
}

/// A Cortex-M begins at the second word of the vector table; in a body for another address it would begin
/// outside the body.
Status check_body(std::size_t slot, const Release::Linking& linking) {
  constexpr std::size_t kVectorBytes = 8;
  const std::size_t size = linking.body.size();
  if (size < kVectorBytes || size > kMaxBodyBytes) {
    return fail(
        ErrorCode::kInvalidArgument,
        fmt::format("{}: {} bytes, expected {} to {}", linking.name, size, kVectorBytes, kMaxBodyBytes),
        fmt::format("give the binary that was linked for slot {}", slot));
  }
  const auto reset = load_le<std::uint32_t>(linking.body.data() + 4);
  const std::uint32_t entry = reset & ~1U;
  if ((reset & 1U) == 0 || entry < linking.address || entry - linking.address >= size) {
    return fail(
        ErrorCode::kInvalidArgument,
        fmt::format("{}: its reset vector is 0x{:08x}, expected an odd number from 0x{:08x} to 0x{:08x}",
                    linking.name, reset, linking.address, linking.address + size - 1),
        fmt::format("check --address{}, and that the binaries of the slots are not swapped", slot));
  }
  return {};
}

protocol::ImageText padded(std::string_view text) {
  protocol::ImageText out{};
  std::ranges::copy(text, out.begin());
  return out;
}

std::span<const unsigned char> signed_part(const HeaderBytes& bytes) {
  return std::span(bytes).first<protocol::kSignedHeaderBytes>();
}

ImageHeader signed_header(const Release& release, std::size_t slot, const SecretKey& key,
                          const protocol::PublicKey& open) {
  const Release::Linking& linking = release.linkings[slot];
  ImageHeader header;
  header.flags = open == kTestPublicKey ? std::uint16_t{protocol::kImageSignedForTest} : std::uint16_t{0};
  header.product = padded(release.product);
  header.version = padded(release.version);
  header.security_counter = release.security_counter;
  header.slot = static_cast<std::uint8_t>(slot);
  header.load_address = linking.address;
  header.body_bytes = static_cast<std::uint32_t>(linking.body.size());
  crypto_hash_sha512(header.body_sha512.data(), reinterpret_cast<const unsigned char*>(linking.body.data()),
                     linking.body.size());
  header.key_id = key_id(open);
  const HeaderBytes bytes = header_bytes(header);
  const auto message = signed_part(bytes);
  std::array<std::uint8_t, crypto_sign_SECRETKEYBYTES> both{};
  protocol::PublicKey again{};
  crypto_sign_seed_keypair(again.data(), both.data(), key.seed().data());
  crypto_sign_detached(header.signature.data(), nullptr, message.data(), message.size(), both.data());
  sodium_memzero(both.data(), both.size());
  return header;
}

bool signature_is_right(const ImageHeader& header, const protocol::PublicKey& key) {
  const HeaderBytes bytes = header_bytes(header);
  const auto message = signed_part(bytes);
  return crypto_sign_verify_detached(header.signature.data(), message.data(), message.size(), key.data()) ==
         0;
}

}  // namespace

Result<Package> sign(const Release& release, const SecretKey& key) {
  if (const Status product = check_text("product", release.product); !product) {
    return std::unexpected(product.error());
  }
  if (const Status version = check_text("version", release.version); !version) {
    return std::unexpected(version.error());
  }
  const protocol::PublicKey open = key.public_key();
  std::array<Image, kImages> images;
  for (std::size_t slot = 0; slot < kImages; ++slot) {
    if (const Status body = check_body(slot, release.linkings[slot]); !body) {
      return std::unexpected(body.error());
    }
    images[slot] = {.header = signed_header(release, slot, key, open), .body = release.linkings[slot].body};
  }
  return Package(std::move(images));
}

Result<protocol::PublicKey> verify(const Package& package, std::span<const protocol::PublicKey> trusted) {
  const auto key = std::ranges::find_if(
      trusted, [&](const protocol::PublicKey& one) { return key_id(one) == package.key(); });
  if (key == trusted.end()) {
    std::string known;
    for (const protocol::PublicKey& one : trusted) {
      known +=
          (known.empty() ? "" : ", ") + text(key_id(one)) + (one == kTestPublicKey ? " (the test key)" : "");
    }
    return fail(ErrorCode::kPermissionDenied,
                fmt::format("signed with key {}, trusted are: {}", text(package.key()),
                            known.empty() ? "none" : known),
                "get the release from its maker, and name the maker's public key with --key");
  }
  for (std::size_t slot = 0; slot < kImages; ++slot) {
    if (!signature_is_right(package.image(slot).header, *key)) {
      return fail(ErrorCode::kPermissionDenied,
                  fmt::format("the signature of image {} is wrong: it is not what key {} signed", slot,
                              text(package.key())),
                  "do not use this file; get the release from its maker again");
    }
  }
  if (package.for_test() != (*key == kTestPublicKey)) {
    return fail(ErrorCode::kPermissionDenied,
                fmt::format("the flag for test keys is {} and the key is {}the test key", package.for_test(),
                            *key == kTestPublicKey ? "" : "not "),
                "sign the release again with scatter firmware sign");
  }
  return *key;
}

}  // namespace scatter::firmware_files
