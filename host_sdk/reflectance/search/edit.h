// Adding to a tree, removing from it, looking up in it. Internal to search/.
#pragma once

#include <cstdint>
#include <vector>

#include "host_sdk/reflectance/search/tree.h"

namespace scatter::search {

/// Range  a finite point.
void insert(Tree& tree, const Point& point, std::uint32_t id);

/// Returns false when there is no such entry.
bool erase(Tree& tree, const Point& point, std::uint32_t id);

/// Ids at exactly this point, in no order, added to `out`.
void find_at(const Tree& tree, const Point& point, std::vector<std::uint32_t>& out);

[[nodiscard]] bool has(const Tree& tree, const Point& point, std::uint32_t id) noexcept;

}  // namespace scatter::search
