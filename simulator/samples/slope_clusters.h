// A few facets that stand for many.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

namespace scatter::simulator {

/// A facet of a height field: its slopes dz/dx, dz/dy and its weight (> 0).
struct SlopePoint {
  double x = 0;
  double y = 0;
  double weight = 0;
};

/// Groups facets of like slope: the group that spreads most is split across its longest axis at its mean
/// until there are `most` groups, then facets move to the nearest mean a few times. Returns   the group of
/// every point, 0..n-1 without gaps, n <= most. The same points give the same groups. Cost      O(points *
/// most).
[[nodiscard]] std::vector<std::size_t> cluster_slopes(std::span<const SlopePoint> points, std::size_t most);

/// Weighted mean and covariance.
struct SlopeMoments {
  double weight = 0;
  double mean_x = 0, mean_y = 0;
  double xx = 0, xy = 0, yy = 0;

  /// Largest eigenvalue of the covariance and the unit vector that belongs to it.
  struct Axis {
    double variance = 0;
    double x = 1, y = 0;
  };
  [[nodiscard]] Axis longest() const noexcept;
};
/// Of each group; every group has points. Shape: group.size() == points.size(), values below `groups`.
[[nodiscard]] std::vector<SlopeMoments> moments_of_groups(std::span<const SlopePoint> points,
                                                          std::span<const std::size_t> group,
                                                          std::size_t groups);

}  // namespace scatter::simulator
