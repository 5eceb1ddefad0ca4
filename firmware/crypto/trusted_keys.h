// The keys that this build trusts: those of SCATTER_RELEASE_KEYS (CMake), or the test key without them.
#pragma once

#include <cstdint>
#include <span>

#include "firmware/keys/test_key.h"

namespace scatter::firmware {

enum class TestKey : std::uint8_t { kTaken, kRefused };

#ifdef SCATTER_RELEASE_BUILD
inline constexpr TestKey kTestKeyOfThisBuild = TestKey::kRefused;
#else
inline constexpr TestKey kTestKeyOfThisBuild = TestKey::kTaken;
#endif

[[nodiscard]] std::span<const TrustedKey> trusted_keys() noexcept;

}  // namespace scatter::firmware
