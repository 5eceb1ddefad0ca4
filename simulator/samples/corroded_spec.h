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
  /// Smoother metal than this drives HS-1 into saturation about the peak of the 60 deg head.
  SheetOptics optics{.metal = "iron", .metal_alpha = 0.25, .backing = 0};
  std::optional<Place> place = Place{};  ///< Nothing: the whole sheet at once (spot=whole).
};

/// Reads "corroded:KEY=VALUE,..."; keys, defaults and ranges: docs/spots.md.
/// Errors    kInvalidArgument naming the key, what was found and its range; side= too coarse for the spot;
///           those of reading the maps.
[[nodiscard]] Result<CorrodedSample> parse_corroded(std::string_view spec);

/// Grows the sheet, or takes it from those that are alive in this process with the same options: all places
/// of one sheet share one growth and one set of maps, which go when the last of them does. Errors    those of
/// Growth::run. Threads   any; the same sheet is never grown twice at the same time.
[[nodiscard]] Result<std::shared_ptr<const TexturedSheet>> corroded_sheet(const CorrodedSample& sample);

}  // namespace scatter::simulator
