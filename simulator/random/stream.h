// Random numbers one after the other, for set-up work; frames use noise.h.
#pragma once

#include <array>
#include <cstdint>

#include "simulator/random/philox.h"

namespace scatter::simulator {

/// Reads the blocks of one key in order. 2^34 words, then it starts again.
class RandomStream {
 public:
  explicit constexpr RandomStream(const RandomKey& key) noexcept : key_(key) {}

  [[nodiscard]] constexpr std::uint32_t bits() noexcept {
    if (used_ == 4) {
      words_ = key_.block(next_++);
      used_ = 0;
    }
    return words_[used_++];
  }
  /// In [0, 1), 53 bits.
  [[nodiscard]] constexpr double uniform() noexcept {
    const std::uint64_t high = bits();
    return static_cast<double>((high << 21U) | (bits() >> 11U)) * 0x1p-53;
  }
  /// Whole number below `bound` (> 0), bias below bound / 2^32.
  [[nodiscard]] constexpr std::uint32_t below(std::uint32_t bound) noexcept {
    return static_cast<std::uint32_t>((std::uint64_t{bits()} * bound) >> 32U);
  }
  /// Standard normal.
  [[nodiscard]] double normal() noexcept;
  /// Poisson with this mean (>= 0); see noise.h for its exactness.
  [[nodiscard]] std::uint32_t poisson(double mean) noexcept;

 private:
  RandomKey key_;
  std::array<std::uint32_t, 4> words_{};
  std::uint32_t next_ = 0;
  std::uint32_t used_ = 4;
};

}  // namespace scatter::simulator
