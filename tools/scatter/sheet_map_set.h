// A corroded sheet as a material of renderers and game engines.
#pragma once

#include <filesystem>

#include "tools/scatter/sheet_files.h"

namespace scatter::cli {

/// Writes into `folder`, beside the files of write_sheet, to which they refer:
///   kGltf  base_color.png, metallic_roughness.png, occlusion.png, corroded.gltf (a quad of the sheet's size
///   in
///          metres, lying in x and y; holes are cut out by the alpha of the base colour)
///   kPbrt  metal.png (share of metal), corroded.pbrt (camera, sky, sun and the quad in millimetres:
///   conductor and
///          coated diffuse, mixed by metal.png; holes by opacity.png)
/// Source    glTF 2.0 specification 3.9 (roughness is the square root of the GGX alpha), 5.22; pbrt-v4 input
/// format.
[[nodiscard]] Status write_map_set(MapSet set, const corrosion::Sheet& sheet,
                                   const corrosion::Appearance& look, const std::filesystem::path& folder);

}  // namespace scatter::cli
