// What the reader and the writer of EXR tiles share. Internal to formats.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "host_sdk/reflectance/direction.h"

namespace scatter::formats {

inline constexpr std::size_t kMostTiles = 4096;
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

}  // namespace scatter::formats
