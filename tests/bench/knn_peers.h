// Other libraries' nearest-neighbour structures behind one shape. Their code is compiled for this
// very machine (-march=native) and linked only into the benchmarks.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "host_sdk/reflectance/search/neighbor_index.h"

namespace scatter::bench {

/// A peer's structure over points that it has copied.
class KnnPeer {
 public:
  virtual ~KnnPeer() = default;

  /// k nearest of each query; returns a sum over all found ids, so that nothing is left out.
  virtual std::uint64_t search(std::span<const search::Point> queries, std::size_t k) = 0;
  /// Squared distances of the k nearest, ascending; in float or in double as the peer computes.
  [[nodiscard]] virtual std::vector<double> distances(const search::Point& query, std::size_t k) = 0;
  /// Adds the next `count` points; only for a peer that grows.
  virtual void grow(std::size_t count) = 0;
};

/// ANN by Mount and Arya, kd-tree with exact search; `bucket` points per leaf.
[[nodiscard]] std::unique_ptr<KnnPeer> ann(std::span<const search::Point> points, std::size_t bucket);
/// nanoflann, KDTreeSingleIndexAdaptor with the simple L2 metric in float.
[[nodiscard]] std::unique_ptr<KnnPeer> nanoflann(std::span<const search::Point> points, std::size_t leaf);
/// nanoflann, KDTreeSingleIndexDynamicAdaptor, empty until `grow`.
[[nodiscard]] std::unique_ptr<KnnPeer> nanoflann_dynamic(std::span<const search::Point> points,
                                                         std::size_t leaf);

}  // namespace scatter::bench
