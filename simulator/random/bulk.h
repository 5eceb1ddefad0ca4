// Many random words at once, for loops that need millions.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "simulator/random/philox.h"

namespace scatter::simulator {

inline constexpr std::size_t kBulkBlocks = 64;
using BulkWords = std::array<std::uint32_t, 4 * kBulkBlocks>;

/// The words of blocks 64 * chunk to 64 * chunk + 63 of the key: word w of block 64 * chunk + b is
/// words[64 * w + b].
/// Cost      vectorised (AVX2 where there is one); no allocation; any number of threads.
void draw_bulk(const RandomKey& key, std::uint32_t chunk, BulkWords& words) noexcept;

}  // namespace scatter::simulator
