// The chance behind the faults: one draw per (seed, kind of fault, position), the same on every run.
#pragma once

#include <array>
#include <cstdint>

namespace scatter::simulator {

/// What a draw decides. Numbers are part of what a seed means; never reuse one.
enum class FaultKey : std::uint32_t {
  kDrop = 1,
  kCorrupt = 2,
  kDuplicate = 3,
  kReorder = 4,
  kTruncate = 5,
  kGarbage = 6,
  kReadout = 7,
  kUsbStall = 8,
  kUsbShort = 9,
  kUsbBabble = 10,
};

/// Four independent uniform 32-bit numbers. `part` tells several draws at one position apart.
[[nodiscard]] std::array<std::uint32_t, 4> fault_draw(std::uint64_t seed, FaultKey key, std::uint64_t index,
                                                      std::uint32_t part = 0) noexcept;

/// True with probability `rate` (0..1, resolution 2^-32).
[[nodiscard]] bool fault_strikes(std::uint64_t seed, FaultKey key, std::uint64_t index, double rate) noexcept;

}  // namespace scatter::simulator
