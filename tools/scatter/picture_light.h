// The light in which pictures of worn metal are drawn: a low sun from the upper left, and a bright sky.
#pragma once

#include <array>

namespace scatter::cli {

/// Towards the sun: x to the right, y up, z out of the sheet; 42 degrees above it.
inline constexpr std::array<float, 3> kSun{-0.50F, 0.55F, 0.67F};
inline constexpr float kSunLight = 1.15F;
inline constexpr float kSkyLight = 0.42F;
inline constexpr float kMirroredSky = 0.85F;

}  // namespace scatter::cli
