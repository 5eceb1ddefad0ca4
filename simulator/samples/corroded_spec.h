// A corroded sheet from text: "corroded:age=25,corrosivity=medium,starting_points=30,seed=1,spot=0.3/0.7".
#pragma once

#include <memory>
#include <optional>
#include <string_view>

#include "host_sdk/error/error.h"
#include "simulator/corrosion/appearance.h"
#include "simulator/corrosion/growth.h"
#include "simulator/corrosion/growth_options.h"
#include "simulator/samples/textured_sheet.h"

namespace scatter::simulator {

/// What the text says.
struct CorrodedSample {
  corrosion::GrowthOptions growth;  ///< age_years is the sample's age.
  corrosion::AppearanceOptions appearance;
  SheetOptics optics;
  std::optional<Place> place = Place{};  ///< Nothing: the whole sheet at once (spot=whole).
};

/// Diameter of the spot that grids are made for [mm]: HS-1's.
inline constexpr double kSpotMm = 3;
/// Cells across a spot's diameter at least.
inline constexpr double kCellsPerSpot = 50;

/// Cells along each side when the text does not say: the next power of two that keeps kCellsPerSpot.
[[nodiscard]] std::size_t side_for(double extent_mm) noexcept;

/// Reads "corroded:KEY=VALUE,..."; keys, defaults and ranges: docs/corrosion.md, "Under the instrument".
/// Errors    kInvalidArgument naming the key, what was found and its range; side= too coarse for the spot;
///           those of reading the maps.
[[nodiscard]] Result<CorrodedSample> parse_corroded(std::string_view spec);

/// Grows the sheet, or takes it from those that are alive in this process with the same options: all places
/// of one sheet share one growth and one set of maps, which go when the last of them does. Errors    those of
/// Growth::run. Threads   any; the same sheet is never grown twice at the same time.
[[nodiscard]] Result<std::shared_ptr<const TexturedSheet>> corroded_sheet(const CorrodedSample& sample);

/// Sheets grown by this process so far: for tests of the sharing.
[[nodiscard]] std::size_t sheets_grown() noexcept;

}  // namespace scatter::simulator
