#include <catch2/catch.hpp>

#include <limits>

#include "tests/unit/reflectance_search/brute_force.h"

namespace scatter::search {
namespace {

void check_batch(const NeighborIndex& index, const std::vector<Point>& queries, std::size_t k,
                 unsigned threads) {
  CAPTURE(k, threads, queries.size());
  std::vector<Neighbor> rows(queries.size() * k);
  REQUIRE(index.nearest_batch(queries, k, rows, threads).has_value());
  for (std::size_t q = 0; q < queries.size(); ++q) {
    std::vector<Neighbor> one(k, {std::numeric_limits<float>::infinity(), 0xFFFFFFFFU});
    (void)index.nearest(queries[q], one);
    const bool same = std::equal(one.begin(), one.end(), rows.begin() + static_cast<std::ptrdiff_t>(q * k));
    CAPTURE(q);
    REQUIRE(same);
  }
}

// Paths over the hemisphere, jumps, repeats, and queries without neighbours in between.
std::vector<Point> mixed_queries() {
  std::vector<Point> queries;
  for (double theta_o = 0; theta_o < 75; theta_o += 2.5) {
    for (double phi_o = 0; phi_o < 360; phi_o += 3.7) {
      queries.push_back(geometry(30, 10, theta_o, phi_o));
    }
  }
  std::mt19937 random(3);
  for (std::size_t n = 0; n < queries.size(); n += 17) {
    queries[n] = random_point(random);
  }
  for (std::size_t n = 5; n < queries.size(); n += 101) {
    queries[n] = queries[n - 1];
  }
  for (std::size_t n = 7; n < queries.size(); n += 203) {
    queries[n].y_o = std::numeric_limits<float>::quiet_NaN();
  }
  return queries;
}

TEST_CASE("A batch gives each query what it gives alone, with any number of threads") {
  const std::vector<Point> queries = mixed_queries();
  for (const std::vector<Point>& points : {goniometric(3), random_points(5000, 9), random_points(7, 9)}) {
    const NeighborIndex index = *NeighborIndex::build(points);
    for (const std::size_t k : {1U, 8U, 10U, 20U, 40U}) {
      check_batch(index, queries, k, 1);
    }
    check_batch(index, queries, 10, 2);
    check_batch(index, queries, 10, 0);
  }
}

TEST_CASE("A batch finds its neighbours among coincident points, duplicates and far queries") {
  std::mt19937 random(4);
  std::vector<Point> lattice(4000);
  for (Point& p : lattice) {
    p = lattice_point(random);
  }
  std::vector<Point> queries(lattice.begin(), lattice.begin() + 1500);
  for (std::size_t n = 0; n < queries.size(); n += 3) {
    queries[n] = {0.5F + static_cast<float>(n) * 1e-5F, 20, -0.25F, 0.125F};
  }
  for (const std::vector<Point>& points :
       {lattice, std::vector<Point>(1000, Point{0.5F, 0, -0.25F, 0.125F})}) {
    const NeighborIndex index = *NeighborIndex::build(points);
    for (const std::size_t k : {1U, 10U, 32U}) {
      check_batch(index, queries, k, 1);
    }
  }
}

// A group of such queries is wide and shares few leaves; an unsorted batch is put in order first.
TEST_CASE("A batch of unsorted queries over a large index gives each what it gives alone") {
  std::mt19937 random(5);
  std::vector<Point> queries(20000);
  for (Point& q : queries) {
    q = random_point(random);
  }
  for (const std::vector<Point>& points : {goniometric(1), random_points(60000, 9)}) {
    check_batch(*NeighborIndex::build(points), queries, 10, 1);
  }
}

TEST_CASE("A batch on an empty index or with k of zero fills the rows up") {
  const NeighborIndex index;
  check_batch(index, mixed_queries(), 3, 2);
  check_batch(index, mixed_queries(), 0, 1);
  check_batch(index, {}, 5, 2);
}

TEST_CASE("A batch without room for its results changes nothing") {
  const NeighborIndex index = *NeighborIndex::build(random_points(50, 1));
  const std::vector<Point> queries(4);
  std::vector<Neighbor> rows(39, {1.0F, 2});
  const Status done = index.nearest_batch(queries, 10, rows);
  REQUIRE_FALSE(done.has_value());
  CHECK(done.error().code == ErrorCode::kInvalidArgument);
  CHECK(rows == std::vector<Neighbor>(39, {1.0F, 2}));
}

}  // namespace
}  // namespace scatter::search
