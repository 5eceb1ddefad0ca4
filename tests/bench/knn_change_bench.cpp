// Growing, removing and batches of the neighbour index.
#include <fmt/core.h>

#include <algorithm>
#include <chrono>
#include <memory>
#include <numeric>
#include <random>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "host_sdk/reflectance/search/neighbor_index.h"
#include "tests/bench/bench.h"
#include "tests/bench/knn_peers.h"
#include "tests/bench/knn_sets.h"

namespace scatter::bench {
namespace {

constexpr std::size_t kNeighbors = 10;
constexpr std::size_t kQueries = 5000;

search::NeighborIndex grown(const std::vector<search::Point>& points) {
  search::NeighborIndex index;
  for (std::size_t n = 0; n < points.size(); ++n) {
    keep(index.add(points[n], static_cast<std::uint32_t>(n)).has_value());
  }
  return index;
}

std::uint64_t search_all(const search::NeighborIndex& index, const std::vector<search::Point>& queries) {
  std::uint64_t sum = 0;
  search::Neighbor found[kNeighbors];
  for (const search::Point& q : queries) {
    sum += index.nearest(q, found) + found[0].id;
  }
  return sum;
}

std::vector<Figure> growth(std::string_view set) {
  const std::vector<search::Point> points = knn_points(set);
  const std::vector<search::Point> queries = random_in_cone(kQueries, 2);
  const auto grow_peer = [&] {
    std::unique_ptr<KnnPeer> peer = nanoflann_dynamic(points, 10);
    peer->grow(points.size());
    return peer;
  };
  std::vector<Figure> figures;
  figures.push_back(run_contest(fmt::format("knn.grow.nanoflann.{}", set),
                                Contest{.unit = "points/s",
                                        .work = static_cast<double>(points.size()),
                                        .ours = [&] { keep(grown(points).size()); },
                                        .peer = "nanoflann dynamic, leaf 10",
                                        .theirs = [&] { keep(grow_peer().get()); }}));
  const search::NeighborIndex index = grown(points);
  const std::unique_ptr<KnnPeer> peer = grow_peer();
  check_agreement(index, *peer, queries, kNeighbors);
  figures.push_back(run_contest(fmt::format("knn.grow.query.nanoflann.{}", set),
                                Contest{.unit = "queries/s",
                                        .work = static_cast<double>(kQueries),
                                        .ours = [&] { keep(search_all(index, queries)); },
                                        .peer = "nanoflann dynamic, leaf 10",
                                        .theirs = [&] { keep(peer->search(queries, kNeighbors)); }}));
  figures.push_back(
      make_figure(fmt::format("knn.grow.memory.{}", set),
                  static_cast<double>(index.memory_bytes()) / static_cast<double>(points.size()),
                  "bytes/point", "the same points built in bulk",
                  static_cast<double>(search::NeighborIndex::build(points)->memory_bytes()) /
                      static_cast<double>(points.size()),
                  Better::kLower));
  return figures;
}

const Benchmark kGrowRandom{"knn.grow.random1e5", [] { return growth("random1e5"); }};
const Benchmark kGrowGonio{"knn.grow.gonio", [] { return growth("gonio"); }};

// A tenth of 1e5 points is taken out and put in again, in random order, over and over.
std::vector<Figure> removal(const std::string& name, search::NeighborIndex index,
                            const std::vector<search::Point>& points) {
  std::vector<std::uint32_t> order(points.size());
  std::iota(order.begin(), order.end(), 0U);
  std::shuffle(order.begin(), order.end(), std::mt19937(1));
  order.resize(order.size() / 10);
  std::vector<double> removals;
  std::vector<double> insertions;
  const auto per_second = [&](auto&& work) {
    const auto begin = std::chrono::steady_clock::now();
    for (const std::uint32_t id : order) {
      work(id);
    }
    const std::chrono::duration<double> taken = std::chrono::steady_clock::now() - begin;
    return static_cast<double>(order.size()) / taken.count();
  };
  constexpr int kRounds = 31;
  for (int round = 0; round < kRounds; ++round) {
    removals.push_back(per_second([&](std::uint32_t id) { keep(index.remove(points[id], id)); }));
    insertions.push_back(per_second([&](std::uint32_t id) { keep(index.add(points[id], id).has_value()); }));
  }
  std::sort(removals.begin(), removals.end());
  std::sort(insertions.begin(), insertions.end());
  return {make_figure(name, removals[kRounds / 2], "points/s", "our insertion", insertions[kRounds / 2],
                      Better::kHigher)};
}

const Benchmark kRemoveBuilt{"knn.remove.built.random1e5", [] {
                               const std::vector<search::Point> points = knn_points("random1e5");
                               return removal("knn.remove.built.random1e5",
                                              *search::NeighborIndex::build(points), points);
                             }};
const Benchmark kRemoveGrown{"knn.remove.grown.random1e5", [] {
                               const std::vector<search::Point> points = knn_points("random1e5");
                               return removal("knn.remove.grown.random1e5", grown(points), points);
                             }};

std::vector<Figure> batch(std::string_view set) {
  const search::NeighborIndex index = *search::NeighborIndex::build(knn_points(set));
  std::vector<search::Point> sorted = random_in_cone(1000000, 3);
  sort_along_curve(sorted);
  const std::vector<search::Point> random = random_in_cone(50000, 4);
  std::vector<search::Neighbor> rows(sorted.size() * kNeighbors);
  const auto run = [&](unsigned threads) {
    keep(index.nearest_batch(sorted, kNeighbors, rows, threads).has_value());
  };
  std::vector<Figure> figures;
  figures.push_back(
      run_contest(fmt::format("knn.batch.threads.{}", set), Contest{.unit = "queries/s",
                                                                    .work = 1e6,
                                                                    .ours = [&] { run(2); },
                                                                    .peer = "one thread",
                                                                    .theirs = [&] { run(1); }}));
  // The contest compares equal work, so that one query at a time gets its own figure of cost.
  Figure single = run_contest(fmt::format("knn.batch.single.{}", set),
                              Contest{.unit = "queries/s",
                                      .work = 1e6,
                                      .ours = [&] { run(1); },
                                      .peer = "one query at a time, random order",
                                      .theirs =
                                          [&] {
                                            for (int n = 0; n < 20; ++n) {
                                              keep(search_all(index, random));
                                            }
                                          }});
  figures.push_back(single);
  // What users have: omega_o over the hemisphere at one omega_i.
  const reflectance::Direction omega_i = reflectance::from_spherical(reflectance::radians(33), 0.1);
  std::vector<search::Point> scan;
  for (double theta_o = 0.3; theta_o < 75; theta_o += 0.75) {
    for (double phi_o = 0; phi_o < 360; phi_o += 0.5) {
      scan.push_back(search::point_of(
          omega_i, reflectance::from_spherical(reflectance::radians(theta_o), reflectance::radians(phi_o))));
    }
  }
  const std::span<search::Neighbor> found = std::span(rows).first(scan.size() * kNeighbors);
  figures.push_back(
      run_contest(fmt::format("knn.batch.scan.{}", set),
                  Contest{.unit = "queries/s",
                          .work = static_cast<double>(scan.size()),
                          .ours = [&] { keep(index.nearest_batch(scan, kNeighbors, found, 1).has_value()); },
                          .peer = "one query at a time, same order",
                          .theirs = [&] { keep(search_all(index, scan)); }}));
  return figures;
}

const Benchmark kBatchGonio{"knn.batch.gonio", [] { return batch("gonio"); }};
const Benchmark kBatchRandom{"knn.batch.random1e5", [] { return batch("random1e5"); }};

}  // namespace
}  // namespace scatter::bench
