#include <sodium.h>

#include <catch2/catch.hpp>
#include <cstring>
#include <vector>

#include "host_sdk/firmware_files/dfu_suffix.h"
#include "host_sdk/firmware_files/package.h"
#include "host_sdk/firmware_files/signing.h"
#include "protocol/crc.h"
#include "protocol/endian.h"
#include "tests/unit/firmware_files/made_release.h"

namespace scatter::firmware_files::test {
namespace {

using protocol::store_le;
using Bytes = std::vector<std::byte>;

const unsigned char* raw(const std::byte* at) {
  return reinterpret_cast<const unsigned char*>(at);
}

/// A header as protocol/image_header.h's table has it, made without the library.
void put_header(std::byte* at, const Release& release, std::size_t slot) {
  const auto& linking = release.linkings[slot];
  std::memcpy(at, "OSFW", 4);
  store_le(at + 4, std::uint16_t{1});
  std::memcpy(at + 8, release.product.data(), release.product.size());
  std::memcpy(at + 40, release.version.data(), release.version.size());
  store_le(at + 72, release.security_counter);
  at[76] = static_cast<std::byte>(slot);
  store_le(at + 80, linking.address);
  store_le(at + 84, static_cast<std::uint32_t>(linking.body.size()));
  crypto_hash_sha512(reinterpret_cast<unsigned char*>(at + 88), raw(linking.body.data()),
                     linking.body.size());
  std::array<unsigned char, 64> hash{};
  crypto_hash_sha512(hash.data(), kRfcPublic.data(), kRfcPublic.size());
  std::memcpy(at + 152, hash.data(), 8);
  std::array<unsigned char, 32> open{};
  std::array<unsigned char, 64> secret{};
  crypto_sign_seed_keypair(open.data(), secret.data(), kRfcSeed.data());
  crypto_sign_detached(reinterpret_cast<unsigned char*>(at + 192), nullptr, raw(at), 192, secret.data());
}

void seal(Bytes& file) {
  store_le(file.data() + 60, protocol::crc32c(std::span(file).first(60)));
}

/// The file as README.md's table has it, made without the library.
Bytes file_by_hand(const Release& release) {
  const std::size_t at0 = 64;
  const std::size_t end0 = at0 + 256 + release.linkings[0].body.size();
  const std::size_t at1 = (end0 + 63) / 64 * 64;
  const std::size_t end1 = at1 + 256 + release.linkings[1].body.size();
  Bytes file(end1);
  std::memcpy(file.data(), "SCFW", 4);
  store_le(file.data() + 4, std::uint16_t{1});
  store_le(file.data() + 6, std::uint16_t{2});
  store_le(file.data() + 8, static_cast<std::uint32_t>(end1));
  store_le(file.data() + 16, static_cast<std::uint32_t>(at0));
  store_le(file.data() + 20, static_cast<std::uint32_t>(end0 - at0));
  store_le(file.data() + 24, static_cast<std::uint32_t>(at1));
  store_le(file.data() + 28, static_cast<std::uint32_t>(end1 - at1));
  seal(file);
  put_header(file.data() + at0, release, 0);
  std::ranges::copy(release.linkings[0].body, file.begin() + at0 + 256);
  put_header(file.data() + at1, release, 1);
  std::ranges::copy(release.linkings[1].body, file.begin() + static_cast<std::ptrdiff_t>(at1 + 256));
  return file;
}

const std::array kTrusted = {kTestPublicKey, kRfcPublic};

}  // namespace

TEST_CASE("A signed package has the bytes of its specification, and they read back") {
  const Release release = made_release();
  const Bytes file = file_by_hand(release);
  CHECK(made_package(release).bytes() == file);
  const auto package = Package::parse(file, "a.scfw");
  REQUIRE(package);
  CHECK(package->product() == "HS-1");
  CHECK(package->version() == "2.0.0");
  CHECK(package->security_counter() == 3);
  CHECK_FALSE(package->for_test());
  CHECK(package->image(1).header.load_address == kAddress1);
  CHECK(package->image(1).body == release.linkings[1].body);
  CHECK(package->bytes() == file);
  CHECK(verify(*package, kTrusted) == kRfcPublic);
}

TEST_CASE("A package reads the same through a DFU suffix, whatever its last bytes are") {
  Release release = made_release();
  auto& body = release.linkings[1].body;
  std::memcpy(body.data() + body.size() - 8, "UFD\x10", 4);  // Looks like a suffix, and is none.
  const Bytes file = made_package(release).bytes();
  CHECK(Package::parse(file, "a.scfw")->bytes() == file);
  Bytes dfu = file;
  const DfuSuffix suffix = dfu_suffix(file);
  dfu.insert(dfu.end(), suffix.begin(), suffix.end());
  CHECK(Package::parse(dfu, "a.dfu")->bytes() == file);
  dfu.back() ^= std::byte{1};
  const auto damaged = Package::parse(dfu, "a.dfu");
  REQUIRE_FALSE(damaged);
  CHECK_THAT(damaged.error().what, Catch::Contains("DFU suffix"));
}

TEST_CASE("No package with any single bit flipped is both read and trusted") {
  const Bytes good = made_package().bytes();
  for (std::size_t bit = 0; bit < 8 * good.size(); ++bit) {
    Bytes bad = good;
    bad[bit / 8] ^= static_cast<std::byte>(1U << (bit % 8));
    const auto package = Package::parse(bad, "a.scfw");
    if (package && verify(*package, kTrusted)) {
      FAIL("bit " << bit % 8 << " of byte " << bit / 8 << " does not matter");
    }
    if (!package) {
      REQUIRE_THAT(package.error().what, Catch::StartsWith("a.scfw: "));
      REQUIRE_FALSE(package.error().remedy.empty());
    }
  }
}

TEST_CASE("No truncated or lengthened package is read") {
  Bytes file = made_package().bytes();
  for (std::size_t size = 0; size < file.size(); ++size) {
    CAPTURE(size);
    REQUIRE_FALSE(Package::parse(std::span(file).first(size), "a.scfw"));
  }
  const auto truncated = Package::parse(std::span(file).first(500), "a.scfw");
  CHECK(truncated.error().code == ErrorCode::kDataLoss);
  CHECK_THAT(truncated.error().what,
             Catch::Contains("the file's size is 500 when it should be " + std::to_string(file.size())));
  file.push_back(std::byte{0});
  CHECK_FALSE(Package::parse(file, "a.scfw"));
}

TEST_CASE("Files whose parts do not belong together are refused with the place and what is expected") {
  const Release release = made_release();
  Bytes file = file_by_hand(release);
  const auto refused = [&](const std::string& says) {
    const auto package = Package::parse(file, "a.scfw");
    REQUIRE_FALSE(package);
    CHECK_THAT(package.error().what, Catch::Contains(says));
  };
  const std::size_t at1 = 448;  // 64 + 256 + 100, rounded up to 64.
  SECTION("container of a later version") {
    store_le(file.data() + 4, std::uint16_t{2});
    seal(file);
    refused("container version 2, this program reads 1");
  }
  SECTION("images that overlap") {
    store_le(file.data() + 24, std::uint32_t{256});
    seal(file);
    refused("offset 24");
  }
  SECTION("one image only") {
    store_le(file.data() + 6, std::uint16_t{1});
    seal(file);
    refused("offset 6");
  }
  SECTION("an image larger than any slot") {
    store_le(file.data() + 20, std::uint32_t{0xFFFF'FFFF});
    seal(file);
    refused("the size of image 0 is 4294967295");
  }
  SECTION("images of two versions") {
    Release other = release;
    other.version = "2.0.1";
    put_header(file.data() + at1, other, 1);
    std::memcpy(file.data() + at1 + 40, "2.0.1", 5);
    refused("images 0 and 1 have different versions");
  }
  SECTION("both images for slot 0") {
    file[at1 + 76] = std::byte{0};
    refused("offset " + std::to_string(at1 + 76) + ": the slot of image 1 is 0 when it should be 1");
  }
  SECTION("a body that is not the signed one") {
    file[64 + 256 + 50] ^= std::byte{0x10};
    refused("offset 320: the SHA-512 of image 0's body");
  }
  SECTION("a header of a later version") {
    store_le(file.data() + 64 + 4, std::uint16_t{2});
    refused("header version 2");
  }
  SECTION("something between the images") {
    file[at1 - 1] = std::byte{7};
    refused("offset 447: padding is 07 when it should be 0");
  }
  SECTION("no firmware file at all") {
    std::memcpy(file.data(), "PK\x03\x04", 4);
    refused("does not begin with SCFW");
  }
}

TEST_CASE("A package is trusted only when a trusted key signed both of its images") {
  const Package package = made_package();
  const std::array<protocol::PublicKey, 1> only_test = {kTestPublicKey};
  const auto stranger = verify(package, only_test);
  REQUIRE_FALSE(stranger);
  CHECK(stranger.error().code == ErrorCode::kPermissionDenied);
  CHECK_THAT(stranger.error().what, Catch::Contains("trusted are: c4075324a1f20817 (the test key)"));
  CHECK_FALSE(verify(package, {}));
  for (const std::size_t slot : {0U, 1U}) {
    Bytes file = package.bytes();
    file[(slot == 0 ? 64 : 448) + 200] ^= std::byte{1};
    const auto forged = verify(*Package::parse(file, "a.scfw"), kTrusted);
    REQUIRE_FALSE(forged);
    CHECK_THAT(forged.error().what, Catch::Contains("signature of image " + std::to_string(slot)));
  }
}

TEST_CASE("What the test key signs says so, and nothing else may say so") {
  const auto test_key = load_secret_key("firmware/keys/test.key");
  REQUIRE(test_key);
  const auto package = sign(made_release(), *test_key);
  REQUIRE(package);
  CHECK(package->for_test());
  CHECK(verify(*package, kTrusted) == kTestPublicKey);
  // The flag is part of what is signed.
  Bytes file = package->bytes();
  for (const std::size_t at : {64 + 6, 448 + 6}) {
    file[at] = std::byte{0};
  }
  CHECK_FALSE(verify(*Package::parse(file, "a.scfw"), kTrusted));
}

TEST_CASE("What cannot be a release is not signed, and the reason names the option to change") {
  Release release = made_release();
  const auto refused = [&](const std::string& what, const std::string& remedy) {
    const auto package = sign(release, SecretKey(kRfcSeed));
    REQUIRE_FALSE(package);
    CHECK(package.error().code == ErrorCode::kInvalidArgument);
    CHECK_THAT(package.error().what, Catch::Contains(what));
    CHECK_THAT(package.error().remedy, Catch::Contains(remedy));
  };
  SECTION("no product") {
    release.product = "";
    refused("product has 0 characters", "--product");
  }
  SECTION("a version of 33 characters") {
    release.version = std::string(33, '1');
    refused("version has 33 characters", "--version");
  }
  SECTION("a version with a line end") {
    release.version = "1\n";
    refused("version", "--version");
  }
  SECTION("an empty body") {
    release.linkings[1].body.clear();
    refused("slot1.bin: 0 bytes", "slot 1");
  }
  SECTION("binaries of the two slots swapped") {
    std::swap(release.linkings[0].body, release.linkings[1].body);
    refused("slot0.bin: its reset vector is 0x60880409", "--address0");
  }
}

TEST_CASE("Texts of 32 characters, the longest, survive") {
  Release release = made_release(std::string(32, 'v'));
  release.product = std::string(32, 'p');
  const auto package = Package::parse(made_package(release).bytes(), "a");
  REQUIRE(package);
  CHECK(package->version() == release.version);
  CHECK(package->product() == release.product);
}

}  // namespace scatter::firmware_files::test
