// Mode::kPhysical: a front that spreads and a surface that deepens behind it.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include "simulator/corrosion/growth.h"

namespace scatter::corrosion {

/// The history of a sheet as two numbers per cell: how far a front in neutral surroundings had come when rust
/// reached the cell (O / R of Gu et al. 2006), and how fast the cell deepens since (R).
///
/// docs/corrosion.md, "Physical mode", has the model and its reasons. `options` have been settled; `notes` go
/// into the result. Errors   kInvalidArgument when there are more starting points than cells that may
/// corrode; kAborted when
///          stopped.
/// Memory   about 40 bytes per cell while it runs, 12 afterwards.
/// Cost     docs/corrosion.md; one thread.
[[nodiscard]] Result<std::shared_ptr<const Growth>> grow_front(GrowthOptions options,
                                                               std::vector<std::string> notes,
                                                               const Growth::Progress& progress,
                                                               const std::stop_token& stop);

/// What such a history consists of, per cell, row major; lives as long as the history.
struct FrontView {
  double skin = 0;  ///< Share of the thickness lost while the front goes on for skin_width_mm.
  double skin_width_mm = 1;
  std::span<const float> births_mm;  ///< Where the clock stood when rust came; infinite where it never does.
  std::span<const float> rates;      ///< Shares of the thickness lost per mm of the clock, besides the skin.
  std::span<const std::uint8_t> opening;  ///< 1 where there never was metal; may be empty (none).
};

/// None for a history of Mode::kThesis.
[[nodiscard]] std::optional<FrontView> front_of(const Growth& growth) noexcept;

/// The clock (tau) at each age, 0..options().age_years, any order; -1 at age 0. Empty for Mode::kThesis.
/// Cost    one pass over the cells for all ages.
[[nodiscard]] std::vector<double> front_clock_mm(const Growth& growth, std::span<const double> ages_years);

}  // namespace scatter::corrosion
