// When a front that starts at some places gets everywhere else.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "simulator/corrosion/growth_options.h"

namespace scatter::corrosion {

/// Entries come out in the order of their keys; what goes in must not lie before what came out last.
/// Cost    O(1) amortised: an entry moves at most once per bit in which it differs from the last one out.
/// Source  Ahuja, Mehlhorn, Orlin, Tarjan 1990, "Faster algorithms for the shortest path problem", one-level
///         radix heap.
class RadixQueue {
 public:
  struct Entry {
    std::uint32_t key = 0;
    std::uint32_t value = 0;
  };

  void push(Entry entry);
  /// True when there is an entry whose key is below `limit`; it is then the next to pop. Otherwise entries
  /// may still be pushed with keys down to `limit`.
  [[nodiscard]] bool has_below(std::uint32_t limit);
  Entry pop();
  [[nodiscard]] bool empty() const noexcept { return size_ == 0; }

 private:
  [[nodiscard]] std::size_t bucket(std::uint32_t key) const noexcept;

  std::array<std::vector<Entry>, 33> buckets_;
  std::uint32_t last_ = 0;   ///< No entry is before it.
  std::uint32_t least_ = 0;  ///< No entry is before it either; kept when nothing could be popped.
  std::size_t size_ = 0;
};

/// Solves |grad T| = slowness with T given at seeds that may be added on the way.
///
/// T is continuous time in any unit, slowness that unit per mm; where it is infinite the front never gets.
/// Error     a front may get away from its seed up to 0.6 cells early and keeps that lead; it does not grow
///           with distance in even metal.
/// Source    Fast marching (Sethian 1996) with two stencils of second order, along the axes and along the
///           diagonals (Hassouna and Farag 2007, "Multistencils fast marching methods", section 3).
/// Threads   one at a time.
class FrontMarch {
 public:
  /// slowness: side * side, row major, > 0.
  FrontMarch(std::vector<float> slowness, std::size_t side, double cell_mm, Border border);

  /// Lets a front start at the middle of `cell` at `time`, not before the last limit of advance(). Nothing
  /// happens where a front has been or none may go.
  void start(std::uint32_t cell, float time);
  /// Goes on while the front's time is below `limit`. Returns the cells that it reached, in order; valid
  /// until the next call.
  std::span<const std::uint32_t> advance(float limit);
  /// No front is left.
  [[nodiscard]] bool done() const noexcept { return queue_.empty(); }

  /// Times so far; above the last limit they are not final, infinite where no front came near.
  [[nodiscard]] std::span<const float> times() const noexcept { return times_; }
  [[nodiscard]] std::vector<float> take_times() && { return std::move(times_); }

 private:
  struct Step {
    int x = 0;
    int y = 0;
  };
  template <typename Around>
  [[nodiscard]] float solve(const Around& around, Step first, Step second, float cost) const;
  void spread_inside(std::uint32_t x, std::uint32_t y);
  void spread_at_border(std::uint32_t x, std::uint32_t y);
  void offer(std::size_t cell, std::uint32_t x, std::uint32_t y, float time);

  std::vector<float> slowness_;
  std::vector<float> times_;
  std::size_t side_;
  float cell_mm_;
  bool toroidal_;
  float now_ = -1;  ///< Time of the last cell reached: times up to it are final.
  RadixQueue queue_;
  std::vector<std::uint32_t> reached_;
};

}  // namespace scatter::corrosion
