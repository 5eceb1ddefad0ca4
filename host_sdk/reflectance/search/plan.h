// How the points of a node are dealt out to its children. Internal to search/.
#pragma once

#include <array>
#include <cstddef>
#include <span>

#include "host_sdk/reflectance/search/tree.h"

namespace scatter::search {

/// How a node's points are dealt out to its children: axis after axis, every group of the axis
/// before is cut at quantiles of the next one, found in a histogram per group.
struct Plan {
  struct Axis {
    std::size_t axis = 0;
    std::size_t parts = 1;
    float lo = 0;
    float scale = 0;
  };
  std::array<Axis, kAxes> axes;
  std::size_t count = 0;
};

/// Where incidences lie on a line, as with any goniometer, the axis that tells them apart; else kAxes.
[[nodiscard]] std::size_t incidence_axis(const Box& box) noexcept;

/// What turns a distance from the box's lower side into a number of a bin. Not positive or infinite
/// where floats cannot tell.
[[nodiscard]] float bin_scale(const Box& box, std::size_t axis, std::size_t bins) noexcept;

/// Cuts the longest side in halves until there are enough cells; false when a side has no length
/// that a float can be divided by. Where there are few incidences (else 0), those are told apart
/// first: a range that shares omega_i is searched in two components.
/// Range  plan as constructed.
[[nodiscard]] bool make_plan(const Box& box, std::size_t children, std::size_t bins, std::size_t incidences,
                             Plan& plan) noexcept;

/// Deals children out to groups of so many points each, at least one to each group.
/// Range  1 <= groups <= children.
void deal_children(std::size_t children, std::size_t groups, std::span<const std::size_t> size,
                   std::span<std::size_t> share) noexcept;

}  // namespace scatter::search
