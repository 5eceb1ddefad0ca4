#include "protocol/crc.h"

#include <catch2/catch.hpp>

#include "tests/unit/protocol/test_bytes.h"

namespace scatter::protocol::test {
namespace {

// PROVES: SPEC 1.8
TEST_CASE("CRC-32C by instruction equals CRC-32C by table for every length, alignment and seed") {
  if (!crc32c_have_hardware()) {
    WARN("this processor has no CRC-32C instruction: the table is compared with itself");
  }
  std::mt19937 random(1);
  const Bytes bytes = random_bytes(random, 40000);
  // All short lengths, and lengths around the ends of the interleaved lanes (768 and 6144 bytes).
  for (std::size_t size = 0; size < 2000; ++size) {
    const auto piece = std::span(bytes).subspan(size % 9, size);
    const auto seed = static_cast<std::uint32_t>(random());
    REQUIRE(crc32c_hardware(piece, seed) == crc32c_table(piece, seed));
    REQUIRE(crc32c(piece, seed) == crc32c_table(piece, seed));
  }
  for (int i = 0; i < 2000; ++i) {
    const std::size_t from = random() % 64;
    const std::size_t size = random() % (bytes.size() - from);
    const auto piece = std::span(bytes).subspan(from, size);
    REQUIRE(crc32c_hardware(piece) == crc32c_table(piece));
  }
}

TEST_CASE("CRC-32C by table equals the definition bit by bit") {
  std::mt19937 random(2);
  for (std::size_t size = 0; size < 300; ++size) {
    const Bytes bytes = random_bytes(random, size);
    REQUIRE(crc32c_table(bytes) == crc32c_bitwise(bytes));
  }
}

TEST_CASE("CRC-32C of two pieces chained is the CRC-32C of the whole") {
  std::mt19937 random(3);
  const Bytes bytes = random_bytes(random, 9000);
  const std::span<const std::byte> all(bytes);
  for (const std::size_t cut : {0, 1, 7, 800, 6200, 8999, 9000}) {
    CHECK(crc32c(all.subspan(cut), crc32c(all.first(cut))) == crc32c(all));
  }
}

TEST_CASE("CRC-32C of two pieces put together is the CRC-32C of the whole") {
  std::mt19937 random(4);
  const Bytes bytes = random_bytes(random, 70000);
  const std::span<const std::byte> all(bytes);
  for (const std::size_t second : {0, 1, 2, 3, 255, 256, 16368, 65535, 65536, 70000}) {
    const Crc32cConcat concat(second);
    const std::uint32_t a = crc32c(all.first(all.size() - second));
    const std::uint32_t b = crc32c(all.last(second));
    CHECK(concat.second_bytes() == second);
    CHECK(concat(a, b) == crc32c(all));
    CHECK(concat(a, crc32c(all)) == b);
  }
}

TEST_CASE("CRC-32C of the tails of a row of messages follows from their payloads' checksums") {
  std::mt19937 random(5);
  TailCrc tails;
  std::uint32_t crc = 0;
  Bytes carried;
  for (const std::size_t tail : {4000, 4000, 0, 1, 4000, 17}) {
    const Bytes payload = random_bytes(random, 16 + tail);
    crc = tails.append(crc, payload, crc32c(payload), tail);
    append(carried, std::span(payload).last(tail));
    CHECK(crc == crc32c(carried));
  }
}

}  // namespace
}  // namespace scatter::protocol::test
