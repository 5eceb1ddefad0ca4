// Many Philox blocks side by side, in a loop that vectorises.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "simulator/random/philox.h"

namespace scatter::simulator {

/// Blocks first, first + 1, ... of the key: word w of block first + l is word[w][l], as RandomKey::block
/// gives it. Inlined, so that it is compiled for the instruction set of its caller.
template <std::size_t kLanes>
[[gnu::always_inline]] inline void philox_lanes(
    const RandomKey& key, std::uint32_t first,
    std::array<std::array<std::uint32_t, kLanes>, 4>& word) noexcept {
  auto& [c0, c1, c2, c3] = word;
  for (std::size_t l = 0; l < kLanes; ++l) {
    c0[l] = first + static_cast<std::uint32_t>(l);
    c1[l] = static_cast<std::uint32_t>(key.index);
    c2[l] = static_cast<std::uint32_t>(key.index >> 32U);
    c3[l] = static_cast<std::uint32_t>(key.purpose);
  }
  auto k0 = static_cast<std::uint32_t>(key.seed);
  auto k1 = static_cast<std::uint32_t>(key.seed >> 32U);
  for (int round = 0; round < 10; ++round) {
    for (std::size_t l = 0; l < kLanes; ++l) {
      const std::uint64_t p0 = std::uint64_t{0xD2511F53U} * c0[l];
      const std::uint64_t p1 = std::uint64_t{0xCD9E8D57U} * c2[l];
      c0[l] = static_cast<std::uint32_t>(p1 >> 32U) ^ c1[l] ^ k0;
      c1[l] = static_cast<std::uint32_t>(p1);
      c2[l] = static_cast<std::uint32_t>(p0 >> 32U) ^ c3[l] ^ k1;
      c3[l] = static_cast<std::uint32_t>(p0);
    }
    k0 += 0x9E3779B9U;
    k1 += 0xBB67AE85U;
  }
}

}  // namespace scatter::simulator
