#include "tests/bench/knn_peers.h"

#include <ANN/ANN.h>

#include <cstdint>
#include <nanoflann.hpp>
#include <numeric>

namespace scatter::bench {

namespace {

class Ann final : public KnnPeer {
 public:
  Ann(std::span<const search::Point> points, std::size_t bucket)
      : points_(annAllocPts(static_cast<int>(points.size()), 4)) {
    for (std::size_t n = 0; n < points.size(); ++n) {
      put(points[n], points_[n]);
    }
    tree_ =
        std::make_unique<ANNkd_tree>(points_, static_cast<int>(points.size()), 4, static_cast<int>(bucket));
  }
  Ann(const Ann&) = delete;
  Ann& operator=(const Ann&) = delete;
  ~Ann() override {
    tree_.reset();
    annDeallocPts(points_);
  }

  std::uint64_t search(std::span<const search::Point> queries, std::size_t k) override {
    std::vector<ANNidx> ids(k);
    std::vector<ANNdist> found(k);
    std::uint64_t sum = 0;
    for (const search::Point& q : queries) {
      ANNcoord at[4];
      put(q, at);
      tree_->annkSearch(at, static_cast<int>(k), ids.data(), found.data(), 0.0);
      for (const ANNidx id : ids) {
        sum += static_cast<std::uint64_t>(id);
      }
    }
    return sum;
  }

  std::vector<double> distances(const search::Point& query, std::size_t k) override {
    std::vector<ANNidx> ids(k);
    std::vector<double> found(k);
    ANNcoord at[4];
    put(query, at);
    tree_->annkSearch(at, static_cast<int>(k), ids.data(), found.data(), 0.0);
    return found;
  }

  void grow(std::size_t) override {}

 private:
  static void put(const search::Point& p, ANNcoord* at) {
    at[0] = p.x_i;
    at[1] = p.y_i;
    at[2] = p.x_o;
    at[3] = p.y_o;
  }

  ANNpointArray points_;
  std::unique_ptr<ANNkd_tree> tree_;
};

// nanoflann asks its user for the points.
struct Cloud {
  std::vector<search::Point> points;
  std::size_t visible = 0;

  [[nodiscard]] std::size_t kdtree_get_point_count() const { return visible; }
  [[nodiscard]] float kdtree_get_pt(std::size_t n, std::size_t axis) const {
    return reinterpret_cast<const float*>(&points[n])[axis];
  }
  template <typename Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }
};

using Metric = ::nanoflann::L2_Simple_Adaptor<float, Cloud>;
using Static = ::nanoflann::KDTreeSingleIndexAdaptor<Metric, Cloud, 4, std::uint32_t>;
using Dynamic = ::nanoflann::KDTreeSingleIndexDynamicAdaptor<Metric, Cloud, 4, std::uint32_t>;

template <typename Tree>
class Nanoflann : public KnnPeer {
 public:
  std::uint64_t search(std::span<const search::Point> queries, std::size_t k) override {
    std::vector<std::uint32_t> ids(k);
    std::vector<float> found(k);
    std::uint64_t sum = 0;
    for (const search::Point& q : queries) {
      ::nanoflann::KNNResultSet<float, std::uint32_t> result(k);
      result.init(ids.data(), found.data());
      tree_->findNeighbors(result, &q.x_i, ::nanoflann::SearchParams());
      sum += std::accumulate(ids.begin(), ids.end(), std::uint64_t{0});
    }
    return sum;
  }

  std::vector<double> distances(const search::Point& query, std::size_t k) override {
    std::vector<std::uint32_t> ids(k);
    std::vector<float> found(k);
    ::nanoflann::KNNResultSet<float, std::uint32_t> result(k);
    result.init(ids.data(), found.data());
    tree_->findNeighbors(result, &query.x_i, ::nanoflann::SearchParams());
    return {found.begin(), found.end()};
  }

 protected:
  explicit Nanoflann(std::span<const search::Point> points) {
    cloud_.points.assign(points.begin(), points.end());
  }

  Cloud cloud_;
  std::unique_ptr<Tree> tree_;
};

class NanoflannStatic final : public Nanoflann<Static> {
 public:
  NanoflannStatic(std::span<const search::Point> points, std::size_t leaf) : Nanoflann(points) {
    cloud_.visible = points.size();
    tree_ = std::make_unique<Static>(4, cloud_, ::nanoflann::KDTreeSingleIndexAdaptorParams(leaf));
  }
  void grow(std::size_t) override {}
};

class NanoflannDynamic final : public Nanoflann<Dynamic> {
 public:
  NanoflannDynamic(std::span<const search::Point> points, std::size_t leaf) : Nanoflann(points) {
    tree_ = std::make_unique<Dynamic>(4, cloud_, ::nanoflann::KDTreeSingleIndexAdaptorParams(leaf),
                                      points.size() + 1);
  }
  void grow(std::size_t count) override {
    for (std::size_t n = 0; n < count && cloud_.visible < cloud_.points.size(); ++n) {
      const auto next = static_cast<std::uint32_t>(cloud_.visible++);
      tree_->addPoints(next, next);
    }
  }
};

}  // namespace

std::unique_ptr<KnnPeer> ann(std::span<const search::Point> points, std::size_t bucket) {
  return std::make_unique<Ann>(points, bucket);
}

std::unique_ptr<KnnPeer> nanoflann(std::span<const search::Point> points, std::size_t leaf) {
  return std::make_unique<NanoflannStatic>(points, leaf);
}

std::unique_ptr<KnnPeer> nanoflann_dynamic(std::span<const search::Point> points, std::size_t leaf) {
  return std::make_unique<NanoflannDynamic>(points, leaf);
}

}  // namespace scatter::bench
