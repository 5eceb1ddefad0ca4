#include "simulator/random/bulk.h"

namespace scatter::simulator {
namespace {

[[gnu::always_inline]] inline void draw(const RandomKey& key, std::uint32_t chunk,
                                        BulkWords& words) noexcept {
  std::array<std::uint32_t, kBulkBlocks> c0;
  std::array<std::uint32_t, kBulkBlocks> c1;
  std::array<std::uint32_t, kBulkBlocks> c2;
  std::array<std::uint32_t, kBulkBlocks> c3;
  for (std::size_t b = 0; b < kBulkBlocks; ++b) {
    c0[b] = chunk * static_cast<std::uint32_t>(kBulkBlocks) + static_cast<std::uint32_t>(b);
    c1[b] = static_cast<std::uint32_t>(key.index);
    c2[b] = static_cast<std::uint32_t>(key.index >> 32U);
    c3[b] = static_cast<std::uint32_t>(key.purpose);
  }
  auto k0 = static_cast<std::uint32_t>(key.seed);
  auto k1 = static_cast<std::uint32_t>(key.seed >> 32U);
  for (int round = 0; round < 10; ++round) {
    for (std::size_t b = 0; b < kBulkBlocks; ++b) {
      const std::uint64_t p0 = std::uint64_t{0xD2511F53U} * c0[b];
      const std::uint64_t p1 = std::uint64_t{0xCD9E8D57U} * c2[b];
      c0[b] = static_cast<std::uint32_t>(p1 >> 32U) ^ c1[b] ^ k0;
      c1[b] = static_cast<std::uint32_t>(p1);
      c2[b] = static_cast<std::uint32_t>(p0 >> 32U) ^ c3[b] ^ k1;
      c3[b] = static_cast<std::uint32_t>(p0);
    }
    k0 += 0x9E3779B9U;
    k1 += 0xBB67AE85U;
  }
  for (std::size_t b = 0; b < kBulkBlocks; ++b) {
    words[b] = c0[b];
    words[kBulkBlocks + b] = c1[b];
    words[2 * kBulkBlocks + b] = c2[b];
    words[3 * kBulkBlocks + b] = c3[b];
  }
}

#if defined(__x86_64__)
[[gnu::target("avx2")]] void draw_avx2(const RandomKey& key, std::uint32_t chunk, BulkWords& words) noexcept {
  draw(key, chunk, words);
}
#endif

}  // namespace

void draw_bulk(const RandomKey& key, std::uint32_t chunk, BulkWords& words) noexcept {
#if defined(__x86_64__)
  if (__builtin_cpu_supports("avx2")) {
    draw_avx2(key, chunk, words);
    return;
  }
#endif
  draw(key, chunk, words);
}

}  // namespace scatter::simulator
