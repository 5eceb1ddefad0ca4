// Exact nearest neighbours among scattering geometries: four floats per point.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "host_sdk/error/error.h"
#include "host_sdk/reflectance/direction.h"

namespace scatter::search {

/// Tangent-plane components of two unit directions, -1..1. Upper and lower hemisphere fall on the
/// same point: transmission needs an index of its own.
struct Point {
  float x_i = 0;
  float y_i = 0;
  float x_o = 0;
  float y_o = 0;

  [[nodiscard]] bool operator==(const Point&) const noexcept = default;
};

[[nodiscard]] constexpr Point point_of(const reflectance::Direction& omega_i,
                                       const reflectance::Direction& omega_o) noexcept {
  return {static_cast<float>(omega_i.x), static_cast<float>(omega_i.y), static_cast<float>(omega_o.x),
          static_cast<float>(omega_o.y)};
}

/// The distance that every search uses, to the bit: float, no fused operations, the two incident
/// components first. (dx_i^2 + dy_i^2) + (dx_o^2 + dy_o^2).
[[nodiscard]] float distance_squared(const Point& a, const Point& b) noexcept;

/// One found point.
struct Neighbor {
  float distance_squared = 0;  ///< As search::distance_squared gives it, >= 0.
  std::uint32_t id = 0;

  [[nodiscard]] bool operator==(const Neighbor&) const noexcept = default;
};

/// Set of points with ids, searched exactly: every result is that of comparing with all points.
///
/// Order     by (distance_squared, id), both ascending: ties go to the smaller id.
/// Points    finite; equal points (a pole holds one per azimuth) and equal ids are allowed, each
///           addition is one entry. -0.0 equals 0.0.
/// Queries   a query with a NaN or infinite component has no neighbours.
/// Structure R-tree of 16-ary nodes with tight boxes over leaves of at most 64 points; boxes and
///           points are tested 4, 8 or 16 at a time, as the processor allows at run time.
/// Memory    22 bytes per point when built in bulk, 15 where many points share each omega_i (they hold
///           the components of omega_o only); up to 29 after changes point by point, about 25 from
///           1e5 points on. `memory_bytes` counts everything and `rebuild` gives the rest back.
/// Threads   const functions from any number of threads; changes need exclusive access.
class NeighborIndex {
 public:
  /// Empty.
  NeighborIndex();
  ~NeighborIndex();
  NeighborIndex(NeighborIndex&&) noexcept;
  NeighborIndex& operator=(NeighborIndex&&) noexcept;

  /// Ids are 0, 1, 2, ... in the order of the span.
  /// Errors  kInvalidArgument: a component is NaN or infinite, or there are more than 2^32 - 1 points.
  /// Cost    about 20 ns per point at 1e5 points; 42 bytes per point of scratch.
  [[nodiscard]] static Result<NeighborIndex> build(std::span<const Point> points);
  /// Shape   ids.size() == points.size(), else kInvalidArgument.
  [[nodiscard]] static Result<NeighborIndex> build(std::span<const Point> points,
                                                   std::span<const std::uint32_t> ids);

  /// Errors  kInvalidArgument: a component is NaN or infinite; nothing changed.
  /// Cost    O(log size); every so many additions or removals (half the size) everything is built
  ///         anew, which keeps searches fast and makes that one call as long as `build`.
  [[nodiscard]] Status add(const Point& point, std::uint32_t id);
  /// Takes out one entry with this point and id, and its memory.
  /// Returns false when there is none.
  bool remove(const Point& point, std::uint32_t id);
  void clear() noexcept;
  /// Builds anew: undoes what many additions and removals cost in memory and speed.
  void rebuild();

  [[nodiscard]] std::size_t size() const noexcept;
  [[nodiscard]] bool empty() const noexcept { return size() == 0; }
  /// All memory held, unused capacity included.
  [[nodiscard]] std::size_t memory_bytes() const noexcept;

  /// The out.size() nearest entries, nearest first.
  /// Returns  how many were written: min(out.size(), size()); 0 for a query that is not finite.
  std::size_t nearest(const Point& query, std::span<Neighbor> out) const noexcept;

  /// All entries with distance_squared <= radius_squared, in order; `out` is replaced. A negative
  /// or NaN radius finds nothing, 0 finds equal points.
  void within(const Point& query, float radius_squared, std::vector<Neighbor>& out) const;

  /// Ids of the entries at exactly this point, ascending; `out` is replaced.
  void find(const Point& point, std::vector<std::uint32_t>& out) const;
  [[nodiscard]] bool contains(const Point& point, std::uint32_t id) const noexcept;

  /// `nearest` of many queries, which need not be sorted; those that lie near one another, as the rows
  /// of a scan, share much of the work.
  /// Shape    out.size() == queries.size() * k: row q holds the neighbours of query q; where there
  ///          are fewer than k (see `nearest`), the rest of the row is {infinity, 2^32 - 1}.
  /// Range    threads >= 1; 0 means one per processor.
  /// Errors   kInvalidArgument: sizes do not fit; out untouched.
  [[nodiscard]] Status nearest_batch(std::span<const Point> queries, std::size_t k, std::span<Neighbor> out,
                                     unsigned threads = 1) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace scatter::search
