// The files that a corroded sheet is written as.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <stop_token>
#include <string_view>

#include "host_sdk/images/image.h"
#include "simulator/corrosion/appearance.h"
#include "simulator/corrosion/sheet.h"

namespace scatter::cli {

/// Files for other programs, beside the maps.
enum class MapSet : std::uint8_t {
  kNone,
  kGltf,  ///< glTF 2.0: textures and a quad with a material.
  kPbrt,  ///< pbrt-v4: textures and a scene.
};

/// Writes height.exr, albedo.exr, regime.png, normal.png, roughness.exr, opacity.png, age.exr, preview.png
/// and the map set's files into `folder`, which exists. docs/corrosion.md says what is in each. Returns   the
/// preview, linear. Errors    of the disk; kAborted when stopped between two files.
[[nodiscard]] Result<images::Image> write_sheet(const corrosion::Sheet& sheet,
                                                const corrosion::AppearanceOptions& options, MapSet set,
                                                const std::filesystem::path& folder,
                                                const std::stop_token& stop);

/// What is told when a ctrl-C ends the work.
[[nodiscard]] std::unexpected<Error> stopped();

}  // namespace scatter::cli
