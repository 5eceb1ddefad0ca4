// The metal left in each cell, and what a hit takes.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "simulator/corrosion/event_setup.h"

namespace scatter::corrosion {

/// As heights, exact in floats (kUnitsPerThickness): each cell may have a bite of its own.
class MetalHeights {
 public:
  explicit MetalHeights(const EventSetup& setup)
      : bite_(setup.bite.data()),
        even_(setup.bite.size() == 1),
        height_(std::size_t{setup.side} * setup.side, 1.0F) {
    for (std::size_t i = 0; i < setup.opening.size(); ++i) {
      height_[i] = setup.opening[i] != 0 ? 0.0F : 1.0F;
    }
  }

  /// Takes a bite, or what is left. Returns the units taken.
  std::int64_t hit(std::uint32_t cell) noexcept {
    const float bite = bite_[even_ ? 0 : cell];
    const float before = height_[cell];
    const float after = before > bite ? before - bite : 0.0F;
    height_[cell] = after;
    return static_cast<std::int64_t>((before - after) * static_cast<float>(kUnitsPerThickness));
  }
  [[nodiscard]] bool gone(std::uint32_t cell) const noexcept { return height_[cell] <= 0; }
  void fetch(std::uint32_t cell) const noexcept {
    __builtin_prefetch(height_.data() + cell, 1);
    if (!even_) {
      __builtin_prefetch(bite_ + cell);
    }
  }

  [[nodiscard]] std::vector<float>& heights() noexcept { return height_; }
  /// Puts units back: the law asked for less. Negative: takes them again.
  void give_back(std::uint32_t cell, std::int64_t units) noexcept {
    height_[cell] += static_cast<float>(static_cast<double>(units) / kUnitsPerThickness);
  }

 private:
  const float* bite_;
  bool even_;
  std::vector<float> height_;
};

/// As numbers of hits, where all cells take the same bite: a quarter of the memory, and memory is what a
/// large sheet costs.
class MetalHits {
 public:
  /// Hits that use a cell up must fit a byte.
  [[nodiscard]] static bool suits(const EventSetup& setup) noexcept {
    return setup.bite.size() == 1 && setup.bite[0] > 0 &&
           std::ceil(1 / static_cast<double>(setup.bite[0])) <= 255;
  }
  explicit MetalHits(const EventSetup& setup)
      : bite_(static_cast<std::int64_t>(static_cast<double>(setup.bite[0]) * kUnitsPerThickness)),
        full_(static_cast<std::uint8_t>(std::ceil(1 / static_cast<double>(setup.bite[0])))),
        last_bite_(static_cast<std::int64_t>(kUnitsPerThickness) - (full_ - 1) * bite_),
        hits_(std::size_t{setup.side} * setup.side) {}

  std::int64_t hit(std::uint32_t cell) noexcept {
    const std::uint8_t hits = hits_[cell];
    if (hits + 1 >= full_) {
      hits_[cell] = full_;
      return hits == full_ ? 0 : last_bite_;
    }
    hits_[cell] = static_cast<std::uint8_t>(hits + 1);
    return bite_;
  }
  [[nodiscard]] bool gone(std::uint32_t cell) const noexcept { return hits_[cell] == full_; }
  void fetch(std::uint32_t cell) const noexcept { __builtin_prefetch(hits_.data() + cell, 1); }

 private:
  std::int64_t bite_;
  std::uint8_t full_;  ///< Hits that use a cell up.
  std::int64_t last_bite_;
  std::vector<std::uint8_t> hits_;
};

}  // namespace scatter::corrosion
