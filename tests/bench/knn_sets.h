// Point sets and queries of the nearest-neighbour benchmarks.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>
#include <vector>

#include "host_sdk/reflectance/search/neighbor_index.h"

namespace scatter::bench {

/// gonio: 4 incidences x 76 x 360, 1 deg, theta_o 0..75 (109,440 points). dense: incidences 0..62,
/// 1 deg apart, of the same (1,723,680). random*: both directions uniform in a cone of 75 deg.
inline constexpr std::array<std::string_view, 5> kKnnSets{"gonio", "dense", "random1e4", "random1e5",
                                                          "random1e6"};

/// Fails (aborts) on a name that is not in the list.
[[nodiscard]] std::vector<search::Point> knn_points(std::string_view set);

/// Both directions uniform in solid angle within 75 deg of the normal.
[[nodiscard]] std::vector<search::Point> random_in_cone(std::size_t count, std::uint64_t seed);

/// In the order of a Z curve over the four components.
void sort_along_curve(std::vector<search::Point>& points);

/// Ends the program when a peer's distances differ from ours by more than float rounding.
class KnnPeer;
void check_agreement(const search::NeighborIndex& ours, KnnPeer& peer,
                     const std::vector<search::Point>& queries, std::size_t k);

}  // namespace scatter::bench
