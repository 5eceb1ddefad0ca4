#include "simulator/random/bulk.h"

#include <algorithm>

#include "simulator/random/philox_lanes.h"

namespace scatter::simulator {
namespace {

[[gnu::always_inline]] inline void draw(const RandomKey& key, std::uint32_t chunk,
                                        BulkWords& words) noexcept {
  std::array<std::array<std::uint32_t, kBulkBlocks>, 4> word;
  philox_lanes(key, chunk * static_cast<std::uint32_t>(kBulkBlocks), word);
  for (std::size_t w = 0; w < word.size(); ++w) {
    std::copy(word[w].begin(), word[w].end(), words.begin() + static_cast<std::ptrdiff_t>(w * kBulkBlocks));
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
