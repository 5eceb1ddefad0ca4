#include "simulator/samples/slope_clusters.h"

#include <algorithm>
#include <cmath>

namespace scatter::simulator {
namespace {

constexpr int kMoves = 3;
/// Spread below which slopes are all alike [1].
constexpr double kAlike = 1e-9;

/// Numbers groups without gaps and gives their number.
std::size_t close_gaps(std::span<std::size_t> group, std::size_t groups) {
  std::vector<std::size_t> name(groups, groups);
  std::size_t next = 0;
  for (std::size_t& g : group) {
    if (name[g] == groups) {
      name[g] = next++;
    }
    g = name[g];
  }
  return next;
}

}  // namespace

SlopeMoments::Axis SlopeMoments::longest() const noexcept {
  const double half = 0.5 * (xx - yy);
  const double root = std::hypot(half, xy);
  // The form that does not cancel.
  const double ax = half >= 0 ? half + root : xy;
  const double ay = half >= 0 ? xy : root - half;
  const double length = std::hypot(ax, ay);
  return {.variance = 0.5 * (xx + yy) + root,
          .x = length > 0 ? ax / length : 1.0,
          .y = length > 0 ? ay / length : 0.0};
}

std::vector<SlopeMoments> moments_of_groups(std::span<const SlopePoint> points,
                                            std::span<const std::size_t> group, std::size_t groups) {
  std::vector<SlopeMoments> found(groups);
  for (std::size_t k = 0; k < points.size(); ++k) {
    SlopeMoments& m = found[group[k]];
    m.weight += points[k].weight;
    m.mean_x += points[k].weight * points[k].x;
    m.mean_y += points[k].weight * points[k].y;
  }
  for (SlopeMoments& m : found) {
    if (m.weight > 0) {
      m.mean_x /= m.weight;
      m.mean_y /= m.weight;
    }
  }
  for (std::size_t k = 0; k < points.size(); ++k) {
    SlopeMoments& m = found[group[k]];
    const double x = points[k].x - m.mean_x;
    const double y = points[k].y - m.mean_y;
    const double share = points[k].weight / m.weight;
    m.xx += share * x * x;
    m.xy += share * x * y;
    m.yy += share * y * y;
  }
  return found;
}

std::vector<std::size_t> cluster_slopes(std::span<const SlopePoint> points, std::size_t most) {
  std::vector<std::size_t> group(points.size(), 0);
  std::size_t groups = points.empty() ? 0 : 1;
  while (groups > 0 && groups < most) {
    const std::vector<SlopeMoments> m = moments_of_groups(points, group, groups);
    std::size_t widest = 0;
    for (std::size_t g = 1; g < groups; ++g) {
      if (m[g].weight * m[g].longest().variance > m[widest].weight * m[widest].longest().variance) {
        widest = g;
      }
    }
    const SlopeMoments::Axis axis = m[widest].longest();
    if (!(axis.variance > kAlike * kAlike)) {
      break;
    }
    for (std::size_t k = 0; k < points.size(); ++k) {
      if (group[k] == widest &&
          (points[k].x - m[widest].mean_x) * axis.x + (points[k].y - m[widest].mean_y) * axis.y > 0) {
        group[k] = groups;
      }
    }
    ++groups;
  }
  for (int move = 0; move < kMoves && groups > 1; ++move) {
    const std::vector<SlopeMoments> m = moments_of_groups(points, group, groups);
    for (std::size_t k = 0; k < points.size(); ++k) {
      double nearest = 0;
      for (std::size_t g = 0; g < groups; ++g) {
        const double x = points[k].x - m[g].mean_x;
        const double y = points[k].y - m[g].mean_y;
        const double distance = x * x + y * y;
        if (g == 0 || distance < nearest) {
          nearest = distance;
          group[k] = g;
        }
      }
    }
    groups = close_gaps(group, groups);
  }
  return group;
}

}  // namespace scatter::simulator
