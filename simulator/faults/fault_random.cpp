#include "simulator/faults/fault_random.h"

#include "simulator/random/philox.h"

namespace scatter::simulator {

std::array<std::uint32_t, 4> fault_draw(std::uint64_t seed, FaultKey key, std::uint64_t index,
                                        std::uint32_t part) noexcept {
  // Positions stay below 2^48: more frames than any run sends.
  const std::uint64_t place = index | static_cast<std::uint64_t>(key) << 48U;
  return RandomKey{.seed = seed, .purpose = Purpose::kLinkFaults, .index = place}.block(part);
}

bool fault_strikes(std::uint64_t seed, FaultKey key, std::uint64_t index, double rate) noexcept {
  return rate > 0 && static_cast<double>(fault_draw(seed, key, index)[0]) < rate * 0x1p32;
}

}  // namespace scatter::simulator
