// Small releases for tests: bodies that begin with a vector table, as a Cortex-M needs it.
#pragma once

#include <catch2/catch.hpp>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "host_sdk/firmware_files/signing.h"
#include "protocol/endian.h"

namespace scatter::firmware_files::test {

inline constexpr std::uint32_t kAddress0 = 0x6080'0400;
inline constexpr std::uint32_t kAddress1 = 0x6088'0400;

/// `size` bytes linked for `address`: stack, reset vector, then bytes that differ from their neighbours.
inline std::vector<std::byte> made_body(std::uint32_t address, std::size_t size, unsigned salt = 0) {
  std::vector<std::byte> out(size);
  for (std::size_t k = 0; k < size; ++k) {
    out[k] = static_cast<std::byte>(k * 31 + (k >> 8U) * 7 + salt);
  }
  protocol::store_le(out.data(), std::uint32_t{0x2001'0000});
  protocol::store_le(out.data() + 4, address + 8 + 1);
  return out;
}

inline Release made_release(const std::string& version = "2.0.0", std::uint32_t counter = 3,
                            std::size_t size = 100) {
  Release release;
  release.product = "HS-1";
  release.version = version;
  release.security_counter = counter;
  release.linkings[0] = {.name = "slot0.bin", .address = kAddress0, .body = made_body(kAddress0, size)};
  release.linkings[1] = {.name = "slot1.bin", .address = kAddress1, .body = made_body(kAddress1, size + 1)};
  return release;
}

/// A key that is not the test key: seed and public key of RFC 8032, section 7.1, TEST 1.
inline constexpr SecretKey::Seed kRfcSeed = {0x9d, 0x61, 0xb1, 0x9d, 0xef, 0xfd, 0x5a, 0x60, 0xba, 0x84, 0x4a,
                                             0xf4, 0x92, 0xec, 0x2c, 0xc4, 0x44, 0x49, 0xc5, 0x69, 0x7b, 0x32,
                                             0x69, 0x19, 0x70, 0x3b, 0xac, 0x03, 0x1c, 0xae, 0x7f, 0x60};
inline constexpr protocol::PublicKey kRfcPublic = {
    0xd7, 0x5a, 0x98, 0x01, 0x82, 0xb1, 0x0a, 0xb7, 0xd5, 0x4b, 0xfe, 0xd3, 0xc9, 0x64, 0x07, 0x3a,
    0x0e, 0xe1, 0x72, 0xf3, 0xda, 0xa6, 0x23, 0x25, 0xaf, 0x02, 0x1a, 0x68, 0xf7, 0x07, 0x51, 0x1a};

/// Signed with the key above.
inline Package made_package(const Release& release = made_release()) {
  auto package = sign(release, SecretKey(kRfcSeed));
  REQUIRE(package);
  return *package;
}

}  // namespace scatter::firmware_files::test
