// Counter-based random bits: a block is a pure function of its key and counter.
#pragma once

#include <array>
#include <cstdint>

namespace scatter::simulator {

/// Philox4x32-10. Four independent uniform 32-bit words for every (counter, key).
/// Source  Salmon et al. 2011, "Parallel random numbers: as easy as 1, 2, 3", section 4.3.
[[nodiscard]] constexpr std::array<std::uint32_t, 4> philox4x32(std::array<std::uint32_t, 4> counter,
                                                                std::array<std::uint32_t, 2> key) noexcept {
  for (int round = 0; round < 10; ++round) {
    const std::uint64_t p0 = std::uint64_t{0xD2511F53U} * counter[0];
    const std::uint64_t p1 = std::uint64_t{0xCD9E8D57U} * counter[2];
    counter = {static_cast<std::uint32_t>(p1 >> 32U) ^ counter[1] ^ key[0], static_cast<std::uint32_t>(p1),
               static_cast<std::uint32_t>(p0 >> 32U) ^ counter[3] ^ key[1], static_cast<std::uint32_t>(p0)};
    key[0] += 0x9E3779B9U;
    key[1] += 0xBB67AE85U;
  }
  return counter;
}

/// What a random number is for. Numbers are part of "same seed, same frames": never reuse one.
enum class Purpose : std::uint32_t {
  kFrameNoise = 1,    ///< Shot and read noise; index = exposure, block = pixel.
  kMonitorNoise = 2,  ///< Index = exposure.
  kPixelGain = 3,     ///< PRNU.
  kPixelOffset = 4,   ///< DSNU.
  kHotPixels = 5,
  kCalibrationDraws = 6,  ///< How the true instrument differs from its certificates.
  kPixelGainDraws = 7,    ///< The same, per pixel.
  kDrift = 8,
  kFaults = 9,       ///< Optics and sensor faults.
  kLinkFaults = 10,  ///< Index = direction and fault; used by simulator/instrument.
  kCorrosion = 11,
  kPatina = 12,  ///< Index: corrosion/patina/draws.h.
};

/// Names one sequence of blocks: block i has counter {i, index low, index high, purpose}.
struct RandomKey {
  std::uint64_t seed = 0;
  Purpose purpose = Purpose::kFrameNoise;
  std::uint64_t index = 0;

  [[nodiscard]] constexpr std::array<std::uint32_t, 4> block(std::uint32_t i) const noexcept {
    return philox4x32({i, static_cast<std::uint32_t>(index), static_cast<std::uint32_t>(index >> 32U),
                       static_cast<std::uint32_t>(purpose)},
                      {static_cast<std::uint32_t>(seed), static_cast<std::uint32_t>(seed >> 32U)});
  }
};

}  // namespace scatter::simulator
