// What the reader and the writer of MERL files share. Internal to formats.
#pragma once

#include <array>
#include <cstddef>

namespace scatter::formats {

inline constexpr std::size_t kMerlHeader = 12;
inline constexpr std::size_t kMerlTheta = 90;
inline constexpr std::size_t kMerlPhi = 180;
inline constexpr std::size_t kMerlCells = kMerlTheta * kMerlTheta * kMerlPhi;
/// f [1/sr] per value of the file: red, green, blue.
inline constexpr std::array<double, 3> kMerlScale{1.0 / 1500, 1.15 / 1500, 1.66 / 1500};

}  // namespace scatter::formats
