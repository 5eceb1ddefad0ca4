// The thesis's corrosion as its pseudocode has it: one scan over all cells per pass.
#pragma once

#include <cstddef>
#include <cstdint>
#include <random>
#include <vector>

#include "simulator/corrosion/growth_options.h"

namespace scatter::reference {

/// Slow and plain, for tests and benchmarks of Mode::kThesis. Shares with the product only its options, the
/// law and the sampling of maps; random numbers, starting points, selection, neighbours and masses are its
/// own. Source  Thesis 5.3; corrosion.md 1.3 to 1.6 with the resolutions of 1.10.
class FullScanCorrosion {
 public:
  explicit FullScanCorrosion(const corrosion::GrowthOptions& options);

  /// Until the target is reached or nothing can corrode any more.
  void run();

  /// 0 untouched, 1 threatened, 2 corroded, 3 corroded all round, 4 hole.
  [[nodiscard]] const std::vector<std::uint8_t>& states() const { return state_; }
  [[nodiscard]] const std::vector<double>& heights() const { return height_; }
  [[nodiscard]] double mass_loss_g_per_m2() const { return removed_; }
  [[nodiscard]] std::uint64_t passes() const { return passes_; }
  [[nodiscard]] std::uint64_t visits() const { return passes_ * state_.size(); }
  [[nodiscard]] std::uint64_t events() const { return events_; }

 private:
  void pass();
  void reach(std::size_t cell);
  void convert(std::size_t cell);
  void remove(std::size_t cell);
  void try_late_seeds();
  [[nodiscard]] bool enclosed(std::size_t x, std::size_t y) const;
  [[nodiscard]] std::size_t draw_place();
  template <typename Visit>
  void around(std::size_t x, std::size_t y, Visit&& visit) const;

  corrosion::GrowthOptions options_;
  std::size_t side_;
  std::vector<std::uint32_t> scratches_;  ///< Weight of a cell in width, 0..65535 and more by exposure.
  std::vector<std::uint32_t> structure_;  ///< The same in depth.
  std::vector<double> drop_;              ///< Share of the thickness lost per hit.
  std::vector<double> height_;
  std::vector<std::uint8_t> state_;
  std::vector<std::size_t> converting_;
  std::uint64_t sum1_ = 0;  ///< Of scratches over state 1.
  std::uint64_t sum3_ = 0;  ///< Of structure over state 3.
  std::mt19937_64 random_;
  double cell_g_per_m2_ = 0;  ///< Loss of the mean when a whole cell goes.
  double target_ = 0;
  double removed_ = 0;
  double late_at_ = 0;
  std::uint64_t passes_ = 0;
  std::uint64_t events_ = 0;
};

}  // namespace scatter::reference
