// OpenEXR tile texture for shaders: one tile per incidence, equirectangular about the specular
// direction (docs: formats.md 6b).
//
// Texel (i, j) of a W x H tile stands at azimuth 2 pi (i + 0.5) / W (0 towards the normal, as in
// reflectance/specular_grid_brdf.h) and radial pi (j + 0.5) / H. Below the horizon: 0, origin 0.
// Tiles lie row by row from the top left: of the first sample rotation by increasing theta_i, then
// of the next.
//
// In a shader: texel k of n is sampled at (k + 0.5) / n, so x = azimuth / (2 pi) and
// y = radial / pi without any offset; wrap x, clamp y. As a 3-D texture of n tiles, theta_i from 0 in equal
// steps to theta_max: z = (theta_i / theta_max (n - 1) + 0.5) / n, clamped.
#pragma once

#include <cstddef>
#include <filesystem>
#include <map>
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
  /// Azimuths of the light on the sample [rad], ascending; empty: those of a grid of several sample
  /// rotations, else 0: the material is taken as isotropic.
  std::vector<double> rotations = {};
  std::string method = "measured";  ///< measured | simulated | model
  /// Added to those of the data, whose keys it replaces.
  std::map<std::string, std::string> metadata = {};
  /// For a 3-D texture: theta_i from 0 in equal steps to the last one, see texture_incidences.
  bool texture_3d = false;
};

/// Incidences of a 3-D texture that ends where these do [rad]: 0 to the last in equal steps, the
/// steps as near as possible to the smallest of these, at most 64 tiles.
[[nodiscard]] std::vector<double> texture_incidences(const std::vector<double>& theta_i);

/// Tiles of any BRDF, with origin, and with sigma (random and systematic in one) where it is
/// known. Data of several sample rotations give tiles of each, and the attribute bsdfTileRotations.
/// When a 3-D texture needs other incidences than the data have, the attribute bsdfResampled says
/// from which. Deterministic.
/// Errors  kInvalidArgument: other than 1 or 3 channels, tile sizes out of 1..4096, more than 4096 tiles or
///         2^28 pixels.
[[nodiscard]] Result<std::string> encode_exr_tiles(const reflectance::Brdf& brdf,
                                                   const ExrTilesOptions& options = {});
[[nodiscard]] Status write_exr_tiles(const reflectance::Brdf& brdf, const std::filesystem::path& path,
                                     const ExrTilesOptions& options = {});

/// Grid about the specular direction with the tiles' origins; metadata "method", "resampled".
/// Errors  kDataLoss: truncated or damaged; kInvalidArgument: an EXR image, but no tile texture, or
///         an atlas.
[[nodiscard]] Result<reflectance::SpecularGridBrdf> decode_exr_tiles(std::string_view bytes,
                                                                     std::string_view name);
[[nodiscard]] Result<reflectance::SpecularGridBrdf> read_exr_tiles(const std::filesystem::path& path);

}  // namespace scatter::formats
