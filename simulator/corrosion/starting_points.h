// Where rust begins: places drawn by susceptibility.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "host_sdk/error/error.h"

namespace scatter::corrosion {

/// Draws cells with a chance in proportion to their weight, in two stages: a row by the sums of the rows,
/// then a cell of that row. A cell of weight 0 is never drawn.
///
/// A pair (u, v) of uniform numbers names the same continuous place on every grid that the same maps were put
/// on, to within a cell.
/// Source  Thesis 5.3.2; corrosion.md 1.4.
/// Threads const functions from any number of threads.
class Places {
 public:
  /// `weights` (>= 0, finite, row major; one value is that of all cells) is kept and must outlive this.
  Places(std::span<const float> weights, std::size_t side);

  /// Cells of weight above 0.
  [[nodiscard]] std::size_t count() const noexcept { return count_; }
  /// The cell at u, v in [0, 1): v picks the row, u the column. Needs count() > 0. Cost: O(side), O(1) where
  /// all cells are alike.
  [[nodiscard]] std::uint32_t at(double u, double v) const noexcept;

 private:
  std::span<const float> weights_;
  std::size_t side_;
  std::size_t count_ = 0;
  std::vector<double> rows_;  ///< Running sums of the rows' sums.
};

/// `count` different cells (`weights` as in Places), point k at the same place on every grid unless its cell
/// was taken: then it is drawn again. Numbers are keyed by (seed, k, attempt), so more points leave the first
/// ones where they were. Errors  kInvalidArgument names starting_points when fewer cells have a weight.
[[nodiscard]] Result<std::vector<std::uint32_t>> draw_starting_points(std::span<const float> weights,
                                                                      std::size_t side, std::uint64_t seed,
                                                                      std::uint32_t count);

/// A place where rust begins by itself once the sheet has lost some metal.
struct LateSeed {
  double mass_g_per_m2 = 0;  ///< Mean loss at which it appears.
  std::uint32_t cell = 0;
  double wait = 0;  ///< Uniform in [0, 1): for whoever lets it wait.
};

/// Late seeds in the order in which they appear: a Poisson process in the mass lost, places by weight.
/// The k-th is the same (mass, place) on every grid.
class LateSeeds {
 public:
  /// `places` must outlive this. No seeds when `per_1000_g_per_m2` is 0 or no cell has a weight.
  LateSeeds(const Places& places, std::uint64_t seed, double per_1000_g_per_m2);

  /// The next one to appear; its mass is infinite when there is none.
  [[nodiscard]] const LateSeed& next() const noexcept { return next_; }
  void advance();

 private:
  const Places* places_;
  std::uint64_t seed_;
  double mean_gap_g_per_m2_;
  std::uint32_t drawn_ = 0;
  LateSeed next_;
};

}  // namespace scatter::corrosion
