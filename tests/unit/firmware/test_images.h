// Firmware images and slots for tests: images signed by the test key or by a stranger, two slots on strict
// flash with a common supply, and a verifier that remembers what it has verified.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <map>
#include <mutex>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <sodium/crypto_hash_sha512.h>
#include <sodium/crypto_sign_ed25519.h>

#include "firmware/crypto/sodium_verifier.h"
#include "firmware/image/marks.h"
#include "firmware/image/slot_layout.h"
#include "firmware/ports/ports.h"
#include "protocol/codec.h"
#include "simulator/faults/cut_flash.h"

namespace scatter::firmware::fake {

inline constexpr std::uint32_t kFirstSlotAddress = 0x6080'0000;

enum class Signer : std::uint8_t { kTestKey, kStranger };

struct ImageSpec {
  std::string product = "HS-1 test";
  std::string version = "1.0.0";
  std::uint32_t counter = 1;
  std::uint8_t slot = 0;
  std::uint32_t slot_bytes = 5 * 4096;  ///< Decides the address of slot 1.
  std::uint32_t body_bytes = 9000;
  Signer signer = Signer::kTestKey;
};

struct Image {
  protocol::ImageHeader header;
  std::vector<std::byte> header_bytes;
  std::vector<std::byte> body;
};

/// The seed in firmware/keys/test.key; a stranger's is anything else.
inline std::array<unsigned char, 32> seed_of(Signer signer) {
  constexpr std::array<unsigned char, 32> kTestSeed{
      0x43, 0x00, 0xD2, 0xD4, 0xA8, 0xD1, 0x44, 0x54, 0x3D, 0x65, 0x17, 0x1B, 0x35, 0x01, 0x76, 0x78,
      0x6E, 0xD4, 0xA1, 0xD3, 0x54, 0x36, 0x58, 0x23, 0x86, 0x01, 0x30, 0x28, 0x88, 0x16, 0x3A, 0x10};
  std::array<unsigned char, 32> stranger{};
  stranger.fill(7);
  return signer == Signer::kTestKey ? kTestSeed : stranger;
}

/// Signs whatever the header says and encodes it.
inline void sign(Image& image, Signer signer) {
  std::array<unsigned char, crypto_sign_ed25519_PUBLICKEYBYTES> public_key{};
  std::array<unsigned char, crypto_sign_ed25519_SECRETKEYBYTES> secret_key{};
  crypto_sign_ed25519_seed_keypair(public_key.data(), secret_key.data(), seed_of(signer).data());
  image.header_bytes.resize(protocol::kImageHeaderBytes);
  (void)protocol::encode(image.header, image.header_bytes);
  crypto_sign_ed25519_detached(image.header.signature.data(), nullptr,
                               reinterpret_cast<const unsigned char*>(image.header_bytes.data()),
                               protocol::kSignedHeaderBytes, secret_key.data());
  (void)protocol::encode(image.header, image.header_bytes);
}

inline Image make_image(const ImageSpec& spec) {
  Image image;
  std::uint32_t state = 0x1234'5678;
  for (const char c : spec.version) {
    state = state * 31 + static_cast<unsigned char>(c);
  }
  for (std::uint32_t i = 0; i < spec.body_bytes; ++i) {
    state = state * 1'664'525 + 1'013'904'223;
    image.body.push_back(static_cast<std::byte>(state >> 24U));
  }
  protocol::ImageHeader& h = image.header;
  h.flags = protocol::kImageSignedForTest;
  std::copy_n(spec.product.begin(), std::min<std::size_t>(spec.product.size(), 32), h.product.begin());
  std::copy_n(spec.version.begin(), std::min<std::size_t>(spec.version.size(), 32), h.version.begin());
  h.security_counter = spec.counter;
  h.slot = spec.slot;
  h.load_address = kFirstSlotAddress + spec.slot * spec.slot_bytes + protocol::kImageBodyOffset;
  h.body_bytes = spec.body_bytes;
  crypto_hash_sha512(h.body_sha512.data(), reinterpret_cast<const unsigned char*>(image.body.data()),
                     image.body.size());
  h.key_id = kTestKey.id;
  sign(image, spec.signer);
  return image;
}

/// SodiumVerifier whose signature checks are remembered by what they checked, for tests that make thousands.
class RememberingVerifier final : public Verifier {
 public:
  bool verify(std::span<const std::byte> message, const protocol::Signature& signature,
              const protocol::KeyId& key) noexcept override {
    static std::map<std::string, bool> known;
    static std::mutex mutex;
    std::string name(reinterpret_cast<const char*>(message.data()), message.size());
    name.append(reinterpret_cast<const char*>(signature.data()), signature.size());
    name.append(reinterpret_cast<const char*>(key.data()), key.size());
    const std::scoped_lock lock(mutex);
    const auto found = known.find(name);
    if (found != known.end()) {
      return found->second;
    }
    return known.emplace(name, sodium_.verify(message, signature, key)).first->second;
  }
  void hash_begin() noexcept override { sodium_.hash_begin(); }
  void hash_add(std::span<const std::byte> bytes) noexcept override { sodium_.hash_add(bytes); }
  protocol::Sha512 hash_end() noexcept override { return sodium_.hash_end(); }

 private:
  SodiumVerifier sodium_{std::span<const TrustedKey>(&kTestKey, 1), TestKey::kTaken};
};

/// Two slots on one supply. A copy is another device with the same cells.
struct TestSlots final : ImageSlots {
  explicit TestSlots(Flash::Geometry geometry = {.unit_bytes = 4096, .units = 5, .program_bytes = 32})
      : parts{simulator::CutFlash(geometry, supply), simulator::CutFlash(geometry, supply)} {}
  TestSlots(const TestSlots& other)
      : supply(other.supply),
        parts{simulator::CutFlash(other.parts[0], supply), simulator::CutFlash(other.parts[1], supply)},
        runs(other.runs) {}
  TestSlots& operator=(const TestSlots&) = delete;

  Flash& slot(std::uint8_t index) noexcept override { return parts[index]; }
  std::uint32_t address(std::uint8_t index) noexcept override {
    const Flash::Geometry g = parts[index].geometry();
    return kFirstSlotAddress + index * g.unit_bytes * g.units;
  }
  std::uint8_t running() noexcept override { return runs; }

  [[nodiscard]] std::uint32_t slot_bytes() {
    const Flash::Geometry g = parts[0].geometry();
    return g.unit_bytes * g.units;
  }
  /// Puts an image there as production does; `marks` in order.
  void install(const Image& image, const std::vector<std::pair<MarkKind, std::uint32_t>>& marks) {
    simulator::CutFlash& flash = parts[image.header.slot];
    for (std::uint32_t unit = 0; unit < flash.geometry().units; ++unit) {
      (void)flash.erase(unit);
    }
    flash.overwrite(0, image.header_bytes);
    flash.overwrite(protocol::kImageBodyOffset, image.body);
    for (const auto& [kind, number] : marks) {
      (void)write_mark(flash, kind, number);
    }
  }
  [[nodiscard]] std::uint64_t violations() const { return parts[0].violations() + parts[1].violations(); }

  simulator::Supply supply;
  std::array<simulator::CutFlash, kCount> parts;
  std::uint8_t runs = kCount;
};

}  // namespace scatter::firmware::fake
