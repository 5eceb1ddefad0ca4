#include "firmware/crypto/sodium_verifier.h"

#include <sodium/crypto_hash_sha512.h>
#include <sodium/crypto_sign_ed25519.h>

namespace scatter::firmware {
namespace {

static_assert(sizeof(crypto_hash_sha512_state) == 208 && alignof(crypto_hash_sha512_state) <= 8);

const unsigned char* bytes_of(std::span<const std::byte> bytes) noexcept {
  return reinterpret_cast<const unsigned char*>(bytes.data());
}

}  // namespace

bool SodiumVerifier::verify(std::span<const std::byte> message, const protocol::Signature& signature,
                            const protocol::KeyId& key) noexcept {
  if (test_key_ == TestKey::kRefused && key == kTestKey.id) {
    return false;
  }
  for (const TrustedKey& trusted : keys_) {
    if (trusted.id != key || (test_key_ == TestKey::kRefused && trusted.key == kTestKey.key)) {
      continue;
    }
    if (crypto_sign_ed25519_verify_detached(signature.data(), bytes_of(message), message.size(),
                                            trusted.key.data()) == 0) {
      return true;
    }
  }
  return false;
}

void SodiumVerifier::hash_begin() noexcept {
  (void)crypto_hash_sha512_init(reinterpret_cast<crypto_hash_sha512_state*>(hash_.data()));
}

void SodiumVerifier::hash_add(std::span<const std::byte> bytes) noexcept {
  (void)crypto_hash_sha512_update(reinterpret_cast<crypto_hash_sha512_state*>(hash_.data()), bytes_of(bytes),
                                  bytes.size());
}

protocol::Sha512 SodiumVerifier::hash_end() noexcept {
  protocol::Sha512 out{};
  (void)crypto_hash_sha512_final(reinterpret_cast<crypto_hash_sha512_state*>(hash_.data()), out.data());
  return out;
}

}  // namespace scatter::firmware
