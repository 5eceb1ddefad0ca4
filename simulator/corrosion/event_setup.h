// What Mode::kThesis makes of the options: weights and bites in whole numbers.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "simulator/corrosion/growth_options.h"

namespace scatter::corrosion {

/// A thickness is this many units. Heights are whole multiples of its inverse and at most 1, so that floats
/// hold them exactly: sums, differences and the mass lost are exact, and equal on every machine.
inline constexpr double kUnitsPerThickness = 0x1p24;

struct EventSetup {
  Border border = Border::kToroidal;
  bool conversion_removes = false;
  std::uint32_t side = 0;
  std::vector<std::uint8_t> opening;  ///< 1 where open; empty when nowhere.
  std::size_t metal_cells = 0;

  /// Height lost per hit, a whole number of units, 0..1; one value when it is the same everywhere.
  std::vector<float> bite;
  float largest_bite = 0;
  /// Chance of a threatened cell to be reached, of 65535 at the most vulnerable place; empty when all cells
  /// but openings are alike.
  std::vector<std::uint16_t> width_weight;
  /// The same for being deepened.
  std::vector<std::uint16_t> depth_weight;
  bool deepens = false;  ///< Some cell has a depth weight above 0.
};

/// From settled options; `susceptibility` as susceptibility_of() gives it, or one value where it is the same
/// everywhere.
[[nodiscard]] EventSetup event_setup(const GrowthOptions& options, std::vector<std::uint8_t> opening,
                                     const std::vector<float>& susceptibility);

/// Loss of the whole sheet in units when each square metre of metal lost this much.
[[nodiscard]] double units_of_loss(const GrowthOptions& options, const EventSetup& setup,
                                   double g_per_m2) noexcept;
/// The whole number of units to take up to an age.
[[nodiscard]] std::int64_t target_units(const GrowthOptions& options, const EventSetup& setup,
                                        double years) noexcept;
[[nodiscard]] double loss_of_units(const GrowthOptions& options, const EventSetup& setup,
                                   double units) noexcept;

}  // namespace scatter::corrosion
