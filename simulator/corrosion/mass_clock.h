// How much metal is gone when a front has come so far, and the other way round.
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <vector>

namespace scatter::corrosion {

/// How a cell loses metal once the front has reached it. Shares are of the sheet's thickness.
///
/// Share lost when the front went on for u [mm]: min(1, skin min(u / width, 1) + rate u).
struct DepthLaw {
  double skin = 0;   ///< Share lost soon after the front's arrival, >= 0.
  double width = 1;  ///< How far the front goes while that happens [mm], > 0.
};

/// Mean share of metal lost as a function of tau, the way of a front in neutral surroundings [mm].
///
/// Every cell's loss is made of straight lines, so the mean is too: it is summed exactly at the edges of
/// bins, 1024 to each doubling of tau, while the front marches; inside the bins asked for, from bend to bend.
/// Threads   const functions from any number of threads.
class MassClock {
 public:
  /// `metal_cells` > 0: those that the mean is over.
  MassClock(const DepthLaw& law, std::size_t metal_cells);

  /// A cell that the front reached at `birth`, in the current bin or later; `rate` in shares per mm, >= 0.
  void add(float birth, float rate);
  /// Upper edge of the current bin [mm].
  [[nodiscard]] double edge() const noexcept { return upper_edge(bins_.size()); }
  /// Ends the current bin: all cells reached before its upper edge were added. Returns the loss at that edge.
  double close_bin();
  /// Loss at the upper edge of the last bin closed.
  [[nodiscard]] double loss() const noexcept { return bins_.empty() ? 0 : bins_.back().loss; }
  /// Nothing more happens to the cells added so far.
  [[nodiscard]] bool idle() const noexcept { return bins_.size() >= changes_.size(); }

  /// Tau at which each of `losses` (above 0, any order) is reached; the upper edge of the last bin where it
  /// is never reached. Shape     births and rates of all cells; infinite births of those that were not added.
  /// Error     1e-12 of the loss, for heights without rounding.
  /// Cost      one pass over the cells.
  [[nodiscard]] std::vector<double> solve(std::span<const double> losses, std::span<const float> births,
                                          std::span<const float> rates) const;

  struct Point {
    double tau = 0;
    double loss = 0;
  };
  /// The upper edges of all bins that were closed.
  [[nodiscard]] std::vector<Point> edges() const;
  /// Number of the bin that holds tau >= 0. Above 2^60 mm all is one bin.
  [[nodiscard]] static std::size_t bin_of(double tau) noexcept;

 private:
  /// Where a cell's rate of loss changes, and by how much.
  struct Bend {
    double tau = 0;
    double slope = 0;
  };
  struct Change {
    double slope = 0;   ///< Sum over the bends of a bin.
    double moment = 0;  ///< The same times the way from each bend to the upper edge.
  };
  struct Bin {
    double slope = 0;  ///< At its lower edge.
    double loss = 0;   ///< At its upper edge.
  };
  [[nodiscard]] static double upper_edge(std::size_t bin) noexcept;
  [[nodiscard]] std::array<Bend, 3> bends(float birth, float rate) const noexcept;

  DepthLaw law_;
  double cells_;
  std::vector<Change> changes_;  ///< By bin, as far as anything happens.
  std::vector<Bin> bins_;        ///< Those that were closed.
  double slope_ = 0;
};

}  // namespace scatter::corrosion
