// Which random numbers patina uses for what.
#pragma once

#include <cstdint>

#include "simulator/random/philox.h"

namespace scatter::corrosion {

/// Numbers are part of "same seed, same piece": never reuse one.
enum class PatinaDraw : std::uint8_t {
  kSeedField = 1,  ///< `first` = scale, `second` = square of its lattice.
  kFalling = 2,    ///< `first` = 0, `second` = step of the calendar.
  kScript = 3,     ///< `first` = 0, `second` = step of the script.
};

[[nodiscard]] constexpr simulator::RandomKey patina_key(std::uint64_t seed, PatinaDraw draw,
                                                        std::uint64_t first, std::uint64_t second) noexcept {
  return {seed, simulator::Purpose::kPatina,
          (static_cast<std::uint64_t>(draw) << 56U) | (first << 48U) | second};
}

}  // namespace scatter::corrosion
