// Bulk construction of a tree. Internal to search/.
#pragma once

#include <cstdint>
#include <span>

#include "host_sdk/reflectance/search/tree.h"

namespace scatter::search {

/// Whether leaves are to hold equally many points, or as differing numbers as leaves of a tree that
/// grows: those outgrow their blocks at different times, and each finds one that another has left.
enum class Fill { kEqual, kGrown };

/// Leaves of at most 64 neighbouring points, all at one depth; about 44 on average, fewer where one
/// component of all points is the same.
/// Range  finite points; ids.size() == points.size(), or empty for 0, 1, 2, ...
[[nodiscard]] Tree build_tree(std::span<const Point> points, std::span<const std::uint32_t> ids, Fill fill);

/// The same entries in a tree built in bulk.
void rebuild(Tree& tree, Fill fill);

/// Smallest box around a leaf's points.
[[nodiscard]] Box box_of(const Leaf& leaf) noexcept;
/// Smallest box around a node's children.
[[nodiscard]] Box box_of(const Node& node) noexcept;

}  // namespace scatter::search
