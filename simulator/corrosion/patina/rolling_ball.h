// The surface that a rolling ball can touch.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

namespace scatter::corrosion {

/// Grey-scale closing of a profile that tiles by a ball: the highest surface nowhere above where the ball,
/// kept on top of the profile, can reach down to.
///
/// Quantity  heights [um], row major, side x side; result nowhere below the input.
/// Range     radius_um >= 0; a ball that fits between the middles of neighbouring cells changes nothing.
/// Cost      O(cells x k^2), k the cells within which the ball is lower than the relief; two buffers.
/// Source    Sternberg 1986, "Grayscale morphology".
[[nodiscard]] std::vector<float> closed_by_ball(std::span<const float> height_um, std::size_t side,
                                                double cell_um, double radius_um);

}  // namespace scatter::corrosion
