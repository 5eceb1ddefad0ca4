// Samples that differ from place to place, from text.
#pragma once

#include <memory>
#include <string>
#include <string_view>

#include "host_sdk/error/error.h"
#include "simulator/samples/textured_sheet.h"

namespace scatter::simulator {

/// True when the text starts with "corroded:" or "patina:"; says nothing about the rest.
[[nodiscard]] bool is_textured_spec(std::string_view spec) noexcept;

/// Errors    those of parse_corroded and corroded_sheet, parse_patina and patina_sheet.
[[nodiscard]] Result<std::shared_ptr<const TexturedSurface>> make_textured_surface(std::string_view spec);

/// The spec with another place: its spot= replaced, or added.
[[nodiscard]] std::string spec_at(std::string_view spec, const Place& place);

/// "0.25/0.5" (u/v, each 0..1), or nothing for anything else.
[[nodiscard]] std::optional<Place> place_from(std::string_view text) noexcept;

}  // namespace scatter::simulator
