#include "simulator/instrument/virtual_slots.h"

#include <algorithm>
#include <array>
#include <span>

#include <fmt/format.h>
#include <sodium/crypto_hash_sha512.h>
#include <sodium/crypto_sign_ed25519.h>

#include "firmware/image/marks.h"
#include "firmware/image/slot_view.h"
#include "protocol/codec.h"

namespace scatter::simulator {
namespace {

/// The secret half of the test key (firmware/keys/test.key), which is public: the simulator is its own
/// factory.
constexpr std::array<unsigned char, crypto_sign_ed25519_SEEDBYTES> kTestSeed{
    0x43, 0x00, 0xD2, 0xD4, 0xA8, 0xD1, 0x44, 0x54, 0x3D, 0x65, 0x17, 0x1B, 0x35, 0x01, 0x76, 0x78,
    0x6E, 0xD4, 0xA1, 0xD3, 0x54, 0x36, 0x58, 0x23, 0x86, 0x01, 0x30, 0x28, 0x88, 0x16, 0x3A, 0x10};

constexpr std::string_view kBody =
    "Firmware that a simulated instrument is made with. The host runs the core itself; nothing here is "
    "executed.";

void put_text(std::string_view text, protocol::ImageText& field) {
  std::copy_n(text.begin(), std::min(text.size(), field.size()), field.begin());
}

/// Header and body, then the mark that keeps them.
bool produce(firmware::Flash& slot, std::uint32_t address, std::string_view product) {
  protocol::ImageHeader header;
  header.flags = protocol::kImageSignedForTest;
  put_text(product, header.product);
  put_text(kProducedVersion, header.version);
  header.security_counter = 1;
  header.load_address = address + protocol::kImageBodyOffset;
  header.body_bytes = static_cast<std::uint32_t>(kBody.size());
  const auto* body = reinterpret_cast<const unsigned char*>(kBody.data());
  (void)crypto_hash_sha512(header.body_sha512.data(), body, kBody.size());
  header.key_id = firmware::kTestKey.id;

  std::array<unsigned char, crypto_sign_ed25519_PUBLICKEYBYTES> public_key{};
  std::array<unsigned char, crypto_sign_ed25519_SECRETKEYBYTES> secret_key{};
  (void)crypto_sign_ed25519_seed_keypair(public_key.data(), secret_key.data(), kTestSeed.data());
  std::array<std::byte, protocol::kImageHeaderBytes> bytes{};
  (void)protocol::encode(header, bytes);
  (void)crypto_sign_ed25519_detached(header.signature.data(), nullptr,
                                     reinterpret_cast<const unsigned char*>(bytes.data()),
                                     protocol::kSignedHeaderBytes, secret_key.data());
  (void)protocol::encode(header, bytes);

  const std::uint32_t granule = slot.geometry().program_bytes;
  std::vector<std::byte> padded((kBody.size() + granule - 1) / granule * granule, std::byte{0xFF});
  std::ranges::copy(std::as_bytes(std::span(kBody)), padded.begin());
  return slot.program(0, bytes) && slot.program(protocol::kImageBodyOffset, padded) &&
         firmware::write_mark(slot, firmware::MarkKind::kConfirmed, 1);
}

std::vector<firmware::TrustedKey> keys_of_the_bench() {
  const std::span<const firmware::TrustedKey> trusted = firmware::trusted_keys();
  std::vector<firmware::TrustedKey> keys(trusted.begin(), trusted.end());
  keys.push_back(firmware::kTestKey);
  return keys;
}

}  // namespace

VirtualSlots::VirtualSlots(FlashImage& flash, std::string_view product)
    : flash_(flash),
      product_(product),
      keys_(keys_of_the_bench()),
      verifier_(keys_, firmware::TestKey::kTaken) {
  if (flash.slots_are_blank()) {
    // A disk that takes no more leaves slots without an image, and the instrument starts in rescue mode.
    (void)produce(flash.slot(0), address(0), product_);
  }
  boot(protocol::ResetReason::kPowerOn);
}

void VirtualSlots::boot(protocol::ResetReason reason) noexcept {
  decision_ = firmware::decide(*this, verifier_, product_, reason);
  if (decision_.action == firmware::BootDecision::Action::kRescue) {
    build_id_ = fmt::format("bootloader {}", kProducedVersion);
    return;
  }
  const firmware::SlotView view = firmware::view_slot(*this, decision_.slot, verifier_, product_);
  build_id_ = fmt::format("openscatter {}", firmware::text_of(view.header.version));
}

}  // namespace scatter::simulator
