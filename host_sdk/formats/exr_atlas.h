// Several materials in one OpenEXR image (docs: formats.md 7).
//
// Every outer tile (one incidence, as in exr_tiles.h) holds inner tiles, one per material, row by
// row, in the same order everywhere. Attributes as of tiles, and bsdfAtlasColumns, bsdfAtlasNames.
// Unused inner tiles are 0.
#pragma once

#include <cstddef>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "host_sdk/error/error.h"
#include "host_sdk/formats/exr_tiles.h"
#include "host_sdk/reflectance/brdf.h"
#include "host_sdk/reflectance/specular_grid_brdf.h"

namespace scatter::formats {

struct AtlasMaterial {
  std::string name;                         ///< 1 to 200 characters, each name once.
  const reflectance::Brdf* brdf = nullptr;  ///< Lives as long as the call.
};

struct AtlasOptions {
  /// Of the tiles. theta_i empty: those of the first material. Sizes count unless the materials
  /// are tiles already and `resample` is not asked for: then theirs.
  ExrTilesOptions tiles = {};
  std::size_t columns = 0;  ///< Inner tiles per row of an outer one; 0: near-square.
  /// Bring all materials to the same tile size and incidences; without it they must agree.
  bool resample = false;
};

/// Errors  kInvalidArgument: no materials, a name twice, materials that differ in incidences, tile
///         size, channels or type (names both), more than 2^28 pixels.
[[nodiscard]] Result<std::string> encode_exr_atlas(std::span<const AtlasMaterial> materials,
                                                   const AtlasOptions& options = {});
[[nodiscard]] Status write_exr_atlas(std::span<const AtlasMaterial> materials,
                                     const std::filesystem::path& path, const AtlasOptions& options = {});

struct AtlasEntry {
  std::string name;
  reflectance::SpecularGridBrdf brdf;
};

/// All materials of an atlas, in its order. A plain tile file gives one entry with an empty name.
/// Errors  as decode_exr_tiles.
[[nodiscard]] Result<std::vector<AtlasEntry>> decode_exr_atlas(std::string_view bytes, std::string_view name);
[[nodiscard]] Result<std::vector<AtlasEntry>> read_exr_atlas(const std::filesystem::path& path);

}  // namespace scatter::formats
