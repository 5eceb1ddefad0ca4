// What the texts of all textured samples have in common: maps, the metal and its backing, the spot; and
// sheets shared by all their places.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "host_sdk/error/error.h"
#include "simulator/corrosion/map.h"
#include "simulator/samples/spec_keys.h"
#include "simulator/samples/textured_sheet.h"

namespace scatter::simulator {

/// Diameter of the spot that grids are made for [mm]: HS-1's.
inline constexpr double kSpotMm = 3;
/// Cells across a spot's diameter at least.
inline constexpr double kCellsPerSpot = 50;

/// Cells along each side when the text does not say: the next power of two that keeps kCellsPerSpot.
[[nodiscard]] std::size_t side_for(double extent_mm) noexcept;

/// A number 0..highest, or the path of a picture (its luminance; a PNG's numbers are taken as they are).
void take_map(SpecKeys& keys, std::string_view key, double highest, corrosion::Map& map);

/// extent_mm and side, of which the spot asks how fine it must be; at most `most_side` cells.
void take_grid(SpecKeys& keys, std::uint64_t most_side, double& extent_mm, std::size_t& side);

/// metal_alpha and backing.
void take_optics(SpecKeys& keys, SheetOptics& optics);

/// spot=u/v or spot=whole (nothing).
void take_spot(SpecKeys& keys, std::optional<Place>& place);

/// Size and contents of a map as text: equal for equal maps.
[[nodiscard]] std::string key_of(const corrosion::Map& map);
/// The same of optics.
[[nodiscard]] std::string key_of(const SheetOptics& optics);

/// The living sheet of that key, else the one that `make` gives: all places of one sheet share one growth and
/// one set of maps, which go when the last of them does. Threads   any; what is asked for while it is being
/// made is waited for, so no sheet is made twice.
[[nodiscard]] Result<std::shared_ptr<const TexturedSheet>> shared_sheet(
    const std::string& key, const std::function<Result<std::shared_ptr<const TexturedSheet>>()>& make);

/// Sheets made by this process so far: for tests of the sharing.
[[nodiscard]] std::size_t sheets_grown() noexcept;

}  // namespace scatter::simulator
