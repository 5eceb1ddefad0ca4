// A tile image or atlas as read from a file. Internal to formats.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "host_sdk/error/error.h"
#include "host_sdk/reflectance/specular_grid_brdf.h"

namespace scatter::formats {

/// Image planes and what the attributes say about them, checked against each other.
struct ExrTileFile {
  std::vector<double> rotation;  ///< Of the tiles' product, ascending [rad].
  std::vector<double> theta_i;   ///< Likewise.
  std::size_t columns = 0;       ///< Outer tiles per row.
  std::size_t tile_width = 0;    ///< Of an inner tile.
  std::size_t tile_height = 0;
  std::size_t atlas_columns = 1;         ///< Inner tiles per row of an outer one.
  std::vector<std::string> atlas_names;  ///< Empty: no atlas.
  std::size_t stride = 0;                ///< Pixels per row.
  std::vector<std::vector<float>> value;
  std::vector<std::vector<float>> sigma;  ///< Empty when unknown.
  std::vector<float> origin;              ///< Empty when unknown.
  /// Type, wavelengths, metadata; no axes and no planes.
  reflectance::SpecularGridBrdf::Content common;

  /// The BRDF of one inner tile (0 where there is no atlas).
  /// Errors  kDataLoss, kInvalidArgument: numbers that are no origin or no value.
  [[nodiscard]] Result<reflectance::SpecularGridBrdf> brdf(std::size_t inner, std::string_view name) const;
};

/// Errors  as decode_exr_tiles.
[[nodiscard]] Result<ExrTileFile> decode_exr_tile_file(std::string_view bytes, std::string_view name);

}  // namespace scatter::formats
