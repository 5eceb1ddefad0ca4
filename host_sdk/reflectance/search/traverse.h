// Searches in a tree. Internal to search/.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "host_sdk/reflectance/search/tree.h"

namespace scatter::search {

/// `count` rows of k neighbours, each filled up with {infinity, 2^32 - 1}; each query starts from
/// what the one before it found.
void nearest_rows(const Tree& tree, const Point* queries, std::size_t count, std::size_t k, Neighbor* out);

/// NeighborIndex::nearest.
[[nodiscard]] std::size_t nearest_one(const Tree& tree, const Point& query, std::span<Neighbor> out);

/// Entries with distance_squared <= radius_squared, in no order, added to `out`.
void collect_within(const Tree& tree, const Point& query, float radius_squared, std::vector<Neighbor>& out);

}  // namespace scatter::search
