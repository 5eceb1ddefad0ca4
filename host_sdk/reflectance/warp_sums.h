// What building a BilinearWarp costs most of: sums along rows. Internal to reflectance.
#pragma once

#include <cstddef>
#include <span>

namespace scatter::reflectance {

/// Cells per block of the sums along rows.
inline constexpr std::size_t kWarpBlock = 16;

/// Entries of one row of sums over `width` nodes.
[[nodiscard]] constexpr std::size_t warp_blocks(std::size_t width) noexcept {
  return (width - 1) / kWarpBlock + 2;
}

/// For each row of nodes the sums of its cells before cell 0, kWarpBlock, 2 kWarpBlock, ..., and that of
/// all; a cell is the mean of its two nodes.
/// Range    values.size() is a multiple of width, which is at least 2.
/// Shape    sums[row * warp_blocks(width) + block].
/// Returns  false: some value is negative or not finite; `sums` then mean nothing.
[[nodiscard]] bool sum_rows(std::span<const float> values, std::size_t width, double* sums) noexcept;

}  // namespace scatter::reflectance
