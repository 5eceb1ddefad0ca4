// The Verifier port on libsodium.
//
// Functions of libsodium that are called: crypto_sign_ed25519_verify_detached, crypto_hash_sha512_init,
// crypto_hash_sha512_update, crypto_hash_sha512_final. None of them needs sodium_init, a heap or random
// numbers.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "firmware/crypto/trusted_keys.h"
#include "firmware/ports/ports.h"

namespace scatter::firmware {

/// RAM: about 240 B, no heap. Threads: one.
class SodiumVerifier final : public Verifier {
 public:
  /// `keys` must outlive the verifier. With TestKey::kRefused the test key counts as unknown even when it is
  /// among them.
  explicit SodiumVerifier(std::span<const TrustedKey> keys = trusted_keys(),
                          TestKey test_key = kTestKeyOfThisBuild) noexcept
      : keys_(keys), test_key_(test_key) {}

  [[nodiscard]] bool verify(std::span<const std::byte> message, const protocol::Signature& signature,
                            const protocol::KeyId& key) noexcept override;
  void hash_begin() noexcept override;
  void hash_add(std::span<const std::byte> bytes) noexcept override;
  [[nodiscard]] protocol::Sha512 hash_end() noexcept override;

 private:
  std::span<const TrustedKey> keys_;
  TestKey test_key_;
  // A crypto_hash_sha512_state, so that no header of libsodium is needed here.
  alignas(8) std::array<std::byte, 208> hash_{};
};

}  // namespace scatter::firmware
