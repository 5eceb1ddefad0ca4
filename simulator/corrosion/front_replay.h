// Fills a sheet from the two numbers per cell that Mode::kPhysical keeps.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "simulator/corrosion/growth_options.h"
#include "simulator/corrosion/mass_clock.h"
#include "simulator/corrosion/sheet.h"

namespace scatter::corrosion {

/// A late seed between its appearance and its outbreak.
struct WaitingSeed {
  std::uint32_t cell = 0;
  float since = 0;  ///< Tau [mm].
};

/// When and how fast cells corrode; all spans are over all cells, opening may be empty (none).
struct FrontHistory {
  DepthLaw law;
  std::span<const float> births;  ///< Tau [mm]; infinite where the front never gets.
  std::span<const float> rates;   ///< Shares of the thickness per mm.
  std::span<const std::uint8_t> opening;
  std::span<const WaitingSeed> late;
};

/// Shows the same sheet at one tau after the other.
///
/// States are those of find_states(), fractions and mass those of account() (cells.h), found row by row in
/// one pass while the row is at hand. Threads   one at a time.
class FrontReplay {
 public:
  /// What `history` refers to must outlive this.
  FrontReplay(const FrontHistory& history, const GrowthOptions& options,
              std::shared_ptr<const std::vector<float>> birth_years);

  /// Height, state, fractions, mass and events at `tau` [mm]; below 0 the sheet is pristine.
  /// Equal bits on every processor.
  /// Cost      about 1 ns per cell (AVX2).
  Sheet& show(double tau);

 private:
  struct Row;
  void deepen(std::size_t y, double tau);
  void find_states(std::size_t y);
  [[nodiscard]] const std::uint8_t* marks(std::ptrdiff_t y) const;

  FrontHistory history_;
  Border border_;
  std::size_t metal_cells_;
  Sheet sheet_;
  std::vector<std::uint8_t> marks_;   ///< Of all rows, each with one more cell on either side.
  std::vector<std::uint8_t> beyond_;  ///< The row beyond a clamped border.
  std::vector<std::uint8_t> sums_;
  double lost_ = 0;
  std::uint64_t corroded_ = 0;
  std::uint64_t deepening_ = 0;
  std::uint64_t holes_ = 0;
};

}  // namespace scatter::corrosion
