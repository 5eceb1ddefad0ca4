// Which random numbers corrosion uses for what.
#pragma once

#include <cstdint>

#include "simulator/random/philox.h"

namespace scatter::corrosion {

/// What a sequence of numbers under Purpose::kCorrosion is for. Part of "same seed, same sheet": never reuse
/// one.
enum class Draw : std::uint32_t {
  kStartingPoint = 1,  ///< Item = point, block = attempt.
  kLateSeed = 2,       ///< Item = late seed; place and gap.
  kEvents = 3,         ///< Item 0 width, 1 depth: candidates of Mode::kThesis, in order.
  kField = 4,          ///< Item = field; Mode::kPhysical.
};

[[nodiscard]] constexpr simulator::RandomKey key_of(std::uint64_t seed, Draw draw,
                                                    std::uint32_t item) noexcept {
  return {seed, simulator::Purpose::kCorrosion, (static_cast<std::uint64_t>(draw) << 32U) | item};
}

/// In [0, 1), 53 bits, of two words.
[[nodiscard]] constexpr double unit_of(std::uint32_t high, std::uint32_t low) noexcept {
  return static_cast<double>((static_cast<std::uint64_t>(high) << 21U) | (low >> 11U)) * 0x1p-53;
}

}  // namespace scatter::corrosion
