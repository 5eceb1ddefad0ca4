// Searches in a tree. Internal to search/.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "host_sdk/reflectance/search/tree.h"

namespace scatter::search {

/// `count` rows of k neighbours, each filled up with {infinity, 2^32 - 1}; queries of the same leaves
/// share work.
/// Range  count < 2^32.
void nearest_rows(const Tree& tree, const Point* queries, std::size_t count, std::size_t k, Neighbor* out);

/// NeighborIndex::nearest.
[[nodiscard]] std::size_t nearest_one(const Tree& tree, const Point& query, std::span<Neighbor> out);

/// Entries with distance_squared <= radius_squared, in no order, added to `out`.
void collect_within(const Tree& tree, const Point& query, float radius_squared, std::vector<Neighbor>& out);

/// One bit per child whose box the point is in (or so close to that its distance squared is 0).
[[nodiscard]] std::uint32_t children_around(const Node& node, const Point& p);

/// A child with the nearest box.
[[nodiscard]] std::size_t nearest_child(const Node& node, const Point& p);

}  // namespace scatter::search
