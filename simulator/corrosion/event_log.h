// What happened in a run of Mode::kThesis, in order.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace scatter::corrosion {

/// Everything else follows from it: which cells were threatened when, how much each event took, how high each
/// cell stands.
struct EventLog {
  /// Marks events that deepened a cell; the others are cells that rust reached.
  static constexpr std::uint32_t kDepth = 0x80000000U;

  struct LateSeed {
    std::size_t before_event;
    std::uint32_t cell;
  };

  std::vector<std::uint32_t> events;  ///< Cell, and kDepth.
  /// Units lost before each event of width, in order; rounded.
  std::vector<float> lost_before_width;
  std::vector<LateSeed> late_seeds;
};

}  // namespace scatter::corrosion
