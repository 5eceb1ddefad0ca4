// OpenEXR tile texture for shaders: one tile per incidence, equirectangular about the specular
// direction (docs: formats.md 6b).
//
// Texel (i, j) of a W x H tile stands at azimuth 2 pi (i + 0.5) / W (0 towards the normal, as in
// reflectance/specular_grid_brdf.h) and radial pi (j + 0.5) / H. Below the horizon: 0, origin 0.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "host_sdk/error/error.h"
#include "host_sdk/reflectance/brdf.h"
#include "host_sdk/reflectance/specular_grid_brdf.h"

namespace scatter::formats {

struct ExrTilesOptions {
  std::size_t width = 360;           ///< Of a tile; the default suits BC6H (sides divisible by 4).
  std::size_t height = 180;          ///< Of a tile.
  std::size_t columns = 0;           ///< Tiles per row; 0: near-square.
  bool half_precision = true;        ///< Values as half, else float. Sigma is always float.
  std::vector<double> theta_i = {};  ///< [rad], ascending; empty: those of the BRDF, or 0 20 40 60 deg.
  std::string method = "measured";   ///< measured | simulated | model
};

/// Tiles of any isotropic BRDF, with origin, and with sigma (random and systematic in one) where
/// it is known. Deterministic.
/// Errors  kInvalidArgument: other than 1 or 3 channels, tile sizes out of 1..4096.
///         kUnimplemented: several sample rotations.
[[nodiscard]] Result<std::string> encode_exr_tiles(const reflectance::Brdf& brdf,
                                                   const ExrTilesOptions& options = {});
[[nodiscard]] Status write_exr_tiles(const reflectance::Brdf& brdf, const std::filesystem::path& path,
                                     const ExrTilesOptions& options = {});

/// Grid about the specular direction with the tiles' origins; metadata "method".
/// Errors  kDataLoss: truncated or damaged; kInvalidArgument: an EXR image, but no tile texture.
[[nodiscard]] Result<reflectance::SpecularGridBrdf> decode_exr_tiles(std::string_view bytes,
                                                                     std::string_view name);
[[nodiscard]] Result<reflectance::SpecularGridBrdf> read_exr_tiles(const std::filesystem::path& path);

}  // namespace scatter::formats
