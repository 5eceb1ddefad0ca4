// What readers and writers of EXR tiles and atlases share. Internal to formats.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "host_sdk/reflectance/brdf.h"
#include "host_sdk/reflectance/direction.h"
#include "host_sdk/reflectance/specular_grid_brdf.h"

namespace scatter::formats {

inline constexpr std::size_t kMostTiles = 4096;
inline constexpr std::size_t kLargestTileSide = 4096;
/// 2^28 pixels: 512 MiB per half channel.
inline constexpr std::size_t kMostTilePixels = std::size_t{1} << 28;
inline constexpr std::string_view kTileMetadataPrefix = "scatter.";

[[nodiscard]] inline std::vector<std::string> tile_channel_names(std::size_t channels) {
  return channels == 1 ? std::vector<std::string>{"Y"} : std::vector<std::string>{"R", "G", "B"};
}

/// Angles of a texel's centre [rad].
[[nodiscard]] inline double azimuth_at(std::size_t i, std::size_t width) noexcept {
  return 2 * reflectance::kPi * (static_cast<double>(i) + 0.5) / static_cast<double>(width);
}
[[nodiscard]] inline double radial_at(std::size_t j, std::size_t height) noexcept {
  return reflectance::kPi * (static_cast<double>(j) + 0.5) / static_cast<double>(height);
}

/// What one tile shows.
struct TileIncidence {
  double rotation = 0;  ///< Sample rotation: azimuth of the light on the sample [rad].
  double theta_i = 0;   ///< [rad]
};

/// Incidences and azimuths of the light that a grid itself has, each ascending, without doubles;
/// other BRDFs have none.
struct OwnIncidences {
  std::vector<double> rotation;
  std::vector<double> theta_i;
};
[[nodiscard]] OwnIncidences own_incidences(const reflectance::Brdf& brdf);

/// Columns that make an image of `tiles` tiles about as wide as high; at least 1.
[[nodiscard]] std::size_t near_square_columns(std::size_t tiles, std::size_t width, std::size_t height);

}  // namespace scatter::formats
