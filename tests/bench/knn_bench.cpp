// Static index against ANN and nanoflann: query, build, memory.
#include <fmt/core.h>
#include <malloc.h>

#include <algorithm>
#include <chrono>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "host_sdk/reflectance/search/neighbor_index.h"
#include "tests/bench/bench.h"
#include "tests/bench/knn_peers.h"
#include "tests/bench/knn_sets.h"

namespace scatter::bench {
namespace {

constexpr std::size_t kNeighbors = 10;
constexpr std::size_t kQueries = 20000;

struct Library {
  std::string name;
  std::unique_ptr<KnnPeer> (*build)(std::span<const search::Point>, std::size_t);
  std::size_t usual_leaf;
  std::vector<std::size_t> leaves;  ///< Tried for `_best`.
};

const std::vector<Library>& libraries() {
  static const std::vector<Library> list{{"ann", ann, 1, {2, 4, 6, 8, 12, 16}},
                                         {"nanoflann", nanoflann, 10, {4, 7, 14, 20, 28, 40}}};
  return list;
}

search::NeighborIndex build(const std::vector<search::Point>& points) {
  return std::move(search::NeighborIndex::build(points)).value();
}

std::uint64_t search_all(const search::NeighborIndex& index, const std::vector<search::Point>& queries) {
  std::uint64_t sum = 0;
  search::Neighbor found[kNeighbors];
  for (const search::Point& q : queries) {
    const std::size_t count = index.nearest(q, found);
    for (std::size_t n = 0; n < count; ++n) {
      sum += found[n].id;
    }
  }
  return sum;
}

double seconds(const std::function<void()>& work) {
  const auto begin = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

// The leaf size with the fastest queries, by the best of three runs each.
std::size_t best_leaf(const Library& library, const std::vector<search::Point>& points,
                      const std::vector<search::Point>& queries) {
  std::size_t best = library.usual_leaf;
  double least = 1e9;
  for (const std::size_t leaf : library.leaves) {
    const std::unique_ptr<KnnPeer> peer = library.build(points, leaf);
    for (int run = 0; run < 3; ++run) {
      const double taken = seconds([&] { keep(peer->search(queries, kNeighbors)); });
      if (taken < least) {
        least = taken;
        best = leaf;
      }
    }
  }
  return best;
}

std::vector<Figure> query(const std::string& name, const Library& library, bool tuned, std::string_view set) {
  const std::vector<search::Point> points = knn_points(set);
  const std::vector<search::Point> queries = random_in_cone(kQueries, 2);
  const search::NeighborIndex index = build(points);
  const std::size_t leaf = tuned ? best_leaf(library, points, queries) : library.usual_leaf;
  const std::unique_ptr<KnnPeer> peer = library.build(points, leaf);
  check_agreement(index, *peer, queries, kNeighbors);
  return {run_contest(name, {.unit = "queries/s",
                             .work = static_cast<double>(kQueries),
                             .ours = [&] { keep(search_all(index, queries)); },
                             .peer = fmt::format("{}, leaf {}", library.name, leaf),
                             .theirs = [&] { keep(peer->search(queries, kNeighbors)); }})};
}

std::vector<Figure> construction(const std::string& name, const Library& library, std::string_view set) {
  const std::vector<search::Point> points = knn_points(set);
  return {run_contest(name, {.unit = "points/s",
                             .work = static_cast<double>(points.size()),
                             .ours = [&] { keep(build(points).size()); },
                             .peer = fmt::format("{}, leaf {}", library.name, library.usual_leaf),
                             .theirs = [&] { keep(library.build(points, library.usual_leaf).get()); }})};
}

// What the heap holds, in and outside of its arenas.
double heap_bytes() {
  const struct mallinfo2 info = mallinfo2();
  return static_cast<double>(info.uordblks) + static_cast<double>(info.hblkhd);
}

std::vector<Figure> memory(const std::string& name, const Library& library, std::string_view set) {
  const std::vector<search::Point> points = knn_points(set);
  const auto count = static_cast<double>(points.size());
  double before = heap_bytes();
  const search::NeighborIndex index = build(points);
  const double ours = (heap_bytes() - before) / count;
  before = heap_bytes();
  const std::unique_ptr<KnnPeer> peer = library.build(points, library.usual_leaf);
  const double theirs = (heap_bytes() - before) / count;
  return {make_figure(name, ours, "bytes/point", fmt::format("{}, leaf {}", library.name, library.usual_leaf),
                      theirs, Better::kLower)};
}

const std::vector<Benchmark> kAll = [] {
  std::vector<Benchmark> all;
  for (const Library& library : libraries()) {
    for (const std::string_view set : kKnnSets) {
      const auto add = [&](const char* pattern, auto run) {
        const std::string name = fmt::format(fmt::runtime(pattern), library.name, set);
        all.emplace_back(name, [name, &library, set, run] { return run(name, library, set); });
      };
      add("knn.query.{}.{}", [](auto& name, auto& with, auto on) { return query(name, with, false, on); });
      add("knn.query.{}_best.{}",
          [](auto& name, auto& with, auto on) { return query(name, with, true, on); });
      add("knn.build.{}.{}", construction);
      add("knn.memory.{}.{}", memory);
    }
  }
  return all;
}();

}  // namespace
}  // namespace scatter::bench
