// Weathered copper from text: "patina:atmosphere=marine,age=25,seed=1,extent_mm=50,spot=0.3/0.7".
#pragma once

#include <memory>
#include <optional>
#include <string_view>

#include "host_sdk/error/error.h"
#include "simulator/corrosion/patina/patina.h"
#include "simulator/samples/textured_sheet.h"

namespace scatter::simulator {

/// What the text says.
struct PatinaSample {
  corrosion::PatinaOptions growth;  ///< age_years is the sample's age.
  SheetOptics optics{.metal = "copper", .metal_alpha = 0.25, .backing = 0};
  std::optional<Place> place = Place{};  ///< Nothing: the whole piece at once (spot=whole).
};

/// Reads "patina:KEY=VALUE,..."; keys and ranges: docs/spots.md.
/// Errors    kInvalidArgument naming the key, what was found and its range; side= too coarse for the spot;
///           those of reading the maps.
[[nodiscard]] Result<PatinaSample> parse_patina(std::string_view spec);

/// As corroded_sheet. Errors: those of Patina::grow.
[[nodiscard]] Result<std::shared_ptr<const TexturedSheet>> patina_sheet(const PatinaSample& sample);

}  // namespace scatter::simulator
