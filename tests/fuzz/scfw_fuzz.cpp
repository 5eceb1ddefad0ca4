// Firmware files, DFU suffixes and key files of any bytes; and headers with right checksums over hostile
// contents.
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string_view>
#include <vector>

#include "host_sdk/firmware_files/dfu_suffix.h"
#include "host_sdk/firmware_files/keys.h"
#include "host_sdk/firmware_files/package.h"
#include "host_sdk/firmware_files/signing.h"
#include "protocol/crc.h"
#include "protocol/endian.h"
#include "tests/fuzz/require.h"

using scatter::fuzz::require;

namespace {

using namespace scatter;
using namespace scatter::firmware_files;
using Bytes = std::vector<std::byte>;

constexpr SecretKey::Seed kSeed = {1, 2, 3};

void read(std::span<const std::byte> bytes, bool may_be_trusted) {
  const auto package = Package::parse(bytes, "fuzz");
  if (!package) {
    require(package.error().what.starts_with("fuzz: ") && !package.error().remedy.empty());
    return;
  }
  // There is one way to write a package; a suffix, if there was one, is the right one.
  const Bytes again = package->bytes();
  require(again.size() <= bytes.size() && std::memcmp(again.data(), bytes.data(), again.size()) == 0);
  if (again.size() != bytes.size()) {
    const auto contents = strip_dfu_suffix(bytes, "fuzz");
    require(contents.has_value() && contents->size() == again.size());
  }
  require(!package->product().empty() && !package->version().empty());
  const std::array<protocol::PublicKey, 1> trusted = {SecretKey(kSeed).public_key()};
  const auto signer = verify(*package, trusted);
  require(!signer || may_be_trusted);
}

/// A valid package around the input, then one hostile change: the first bytes choose where and what, and the
/// header's checksum is made right again so that the change is met by the rules behind it.
void forge(std::span<const std::byte> input) {
  if (input.size() < 8) {
    return;
  }
  const auto at = protocol::load_le<std::uint16_t>(input.data());
  const auto value = protocol::load_le<std::uint32_t>(input.data() + 2);
  const bool change = (static_cast<unsigned>(input[6]) & 1U) != 0;
  Release release;
  release.product = "HS-1";
  release.version.assign(1, '1');
  for (std::size_t slot = 0; slot < kImages; ++slot) {
    auto& linking = release.linkings[slot];
    linking.address = 0x1000U + static_cast<std::uint32_t>(slot) * 0x10'0000U;
    linking.body.assign(8, std::byte{0});
    protocol::store_le(linking.body.data() + 4, linking.address + 1);
    linking.body.insert(linking.body.end(), input.begin() + 7, input.end());
  }
  const auto package = sign(release, SecretKey(kSeed));
  require(package.has_value());
  const Bytes good = package->bytes();
  Bytes file = good;
  if (change) {
    const std::size_t place = at % (file.size() - 3);
    protocol::store_le(file.data() + place, value);
    protocol::store_le(file.data() + 60, protocol::crc32c(std::span(file).first(60)));
  }
  read(file, file == good);
  if (file == good) {
    require(Package::parse(file, "fuzz").has_value());
    const DfuSuffix suffix = dfu_suffix(file);
    file.insert(file.end(), suffix.begin(), suffix.end());
    require(Package::parse(file, "fuzz").has_value());
  }
}

void read_key(std::string_view text) {
  const auto open = parse_public_key(text, "fuzz");
  const auto secret = parse_secret_key(text, "fuzz");
  require(!open || !secret);
  require(open.has_value() || open.error().what.starts_with("fuzz: "));
  if (secret) {
    require(text.starts_with("openscatter-secret-key-1") && text.size() >= 89);
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::span<const std::byte> input(reinterpret_cast<const std::byte*>(data), size);
  read(input, false);
  forge(input);
  read_key({reinterpret_cast<const char*>(data), size});
  return 0;
}
