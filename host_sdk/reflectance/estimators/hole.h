// One connected set of grid nodes without values, and the smooth surface over it.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "host_sdk/reflectance/grid_brdf.h"

namespace scatter::reflectance {

/// The pole is one point: all its nodes belong to the same hole, as one unknown.
struct Hole {
  std::vector<std::uint32_t> unknown;  ///< Nodes; the pole as node 0.
  std::vector<std::uint32_t> rim;      ///< Nodes with values next to it; the pole as node 0.
  bool reaches_last_row = false;
};

/// Holes of a part: nodes with is_missing true, joined across rows, columns and the seam at 360 deg.
/// Shape  is_missing has one element per node; at the pole all columns alike.
[[nodiscard]] std::vector<Hole> find_holes(const GridBrdf::Content& content,
                                           const std::vector<bool>& is_missing);

/// Solves Laplace's equation over one hole and writes the result to its nodes of `plane`, a whole pole at
/// once. Values around the hole are read from `plane`. Beyond the last row nothing flows.
/// Precision  1e-6 of the range of the values around it.
void fill_hole(const GridBrdf::Content& content, const Hole& hole, std::span<float> plane);

}  // namespace scatter::reflectance
