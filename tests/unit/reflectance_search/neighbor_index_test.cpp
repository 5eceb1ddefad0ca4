#include "host_sdk/reflectance/search/neighbor_index.h"

#include <hwy/targets.h>
#include <catch2/catch.hpp>

#include <limits>
#include <utility>

#include "tests/unit/reflectance_search/brute_force.h"

namespace scatter::search {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInfinity = std::numeric_limits<float>::infinity();

NeighborIndex built(const std::vector<Point>& points) {
  auto index = NeighborIndex::build(points);
  REQUIRE(index.has_value());
  return std::move(*index);
}

// All searches at one place against brute force.
void check_at(const NeighborIndex& index, const BruteForce& all, const Point& q) {
  CAPTURE(q.x_i, q.y_i, q.x_o, q.y_o, index.size());
  for (const std::size_t k : {1U, 7U, 10U, 16U, 17U, 32U, 33U, 100U}) {
    CAPTURE(k);
    const bool same = nearest(index, q, k) == all.nearest(q, k);
    CHECK(same);
  }
  std::vector<Neighbor> near;
  for (const float radius_squared : {0.0F, 1e-4F, 0.25F, 0.5F, 1.0F}) {
    CAPTURE(radius_squared);
    index.within(q, radius_squared, near);
    const bool same = near == all.within(q, radius_squared);
    CHECK(same);
  }
  std::vector<std::uint32_t> here;
  index.find(q, here);
  CHECK(here == all.find(q));
}

void check_everywhere(const std::vector<Point>& points, int queries) {
  const NeighborIndex index = built(points);
  const BruteForce all(points);
  REQUIRE(index.size() == points.size());
  std::mt19937 random(5);
  for (int n = 0; n < queries; ++n) {
    check_at(index, all, random_point(random));
    check_at(index, all, points[random() % points.size()]);
  }
  // Outside of every box.
  check_at(index, all, {3, -4, 5, -6});
}

// PROVES: reflectance.md 4, "exactly the neighbours that brute force returns (ties by index)".
TEST_CASE("Every search of a built index returns what brute force returns") {
  SECTION("goniometric points, whose poles coincide") {
    check_everywhere(goniometric(3), 60);
  }
  SECTION("random directions") {
    check_everywhere(random_points(10000, 1), 60);
  }
  SECTION("a lattice of duplicates") {
    std::mt19937 random(2);
    std::vector<Point> points(5000);
    for (Point& p : points) {
      p = lattice_point(random);
    }
    check_everywhere(points, 60);
  }
  SECTION("one place only") {
    check_everywhere(std::vector<Point>(1000, Point{0.5F, 0, -0.25F, 0.125F}), 3);
  }
  SECTION("a line") {
    std::vector<Point> points;
    for (int n = 0; n < 3000; ++n) {
      points.push_back({0, 0, std::ldexp(1.0F, -(n % 140)), static_cast<float>(n / 140)});
    }
    check_everywhere(points, 20);
  }
}

TEST_CASE("Every number of points builds an index that finds all of them") {
  const std::vector<Point> points = random_points(1200, 3);
  for (std::size_t count = 1; count <= points.size(); count += 1 + count / 40) {
    CAPTURE(count);
    const std::vector<Point> some(points.begin(), points.begin() + static_cast<std::ptrdiff_t>(count));
    const NeighborIndex index = built(some);
    const BruteForce all(some);
    const bool same = nearest(index, points[0], count + 5) == all.nearest(points[0], count + 5);
    CHECK(same);
  }
}

TEST_CASE("All instruction sets find the same neighbours") {
  const std::vector<Point> points = goniometric(3);
  const BruteForce all(points);
  const NeighborIndex index = built(points);
  std::int64_t targets = hwy::SupportedTargets();
  int tried = 0;
  while (targets != 0) {
    const std::int64_t target = targets & -targets;
    targets &= targets - 1;
    hwy::SetSupportedTargetsForTest(target);
    CAPTURE(hwy::TargetName(target));
    std::mt19937 random(7);
    for (int n = 0; n < 20; ++n) {
      check_at(index, all, random_point(random));
    }
    ++tried;
  }
  hwy::SetSupportedTargetsForTest(0);
  CHECK(tried >= 1);
}

TEST_CASE("The 360 coincident points of a pole come back by ascending id") {
  const std::vector<Point> points = goniometric(1);
  const NeighborIndex index = built(points);
  const Point pole = geometry(20, 0, 0, 0);
  const std::uint32_t first = 76 * 360;
  const std::vector<Neighbor> found = nearest(index, pole, 360);
  for (std::uint32_t n = 0; n < 360; ++n) {
    CHECK(found[n] == Neighbor{0.0F, first + n});
  }
  std::vector<std::uint32_t> ids;
  index.find(pole, ids);
  CHECK(ids.size() == 360);
}

TEST_CASE("Ties go to the smaller id whatever the order of building") {
  const std::vector<Point> points(200, Point{0.1F, 0.2F, 0.3F, 0.4F});
  std::vector<std::uint32_t> ids(200);
  for (std::uint32_t n = 0; n < 200; ++n) {
    ids[n] = (n * 77) % 200 + 1000;
  }
  const auto index = NeighborIndex::build(points, ids);
  REQUIRE(index.has_value());
  const std::vector<Neighbor> found = nearest(*index, {0.1F, 0.2F, 0.3F, 0.5F}, 12);
  for (std::uint32_t n = 0; n < 12; ++n) {
    CHECK(found[n].id == 1000 + n);
  }
}

TEST_CASE("An empty index answers with nothing") {
  NeighborIndex index;
  CHECK(index.empty());
  CHECK(nearest(index, {}, 10).empty());
  std::vector<Neighbor> near{{1, 1}};
  index.within({}, 10, near);
  CHECK(near.empty());
  std::vector<std::uint32_t> ids{1};
  index.find({}, ids);
  CHECK(ids.empty());
  CHECK_FALSE(index.remove({}, 0));
  CHECK_FALSE(index.contains({}, 0));
  index.rebuild();
  CHECK(index.empty());
  const auto of_nothing = NeighborIndex::build({});
  REQUIRE(of_nothing.has_value());
  CHECK(of_nothing->empty());
}

TEST_CASE("k of zero finds nothing, k above the number of points finds all of them") {
  const std::vector<Point> points = random_points(50, 4);
  const NeighborIndex index = built(points);
  const BruteForce all(points);
  CHECK(nearest(index, points[3], 0).empty());
  for (const std::size_t k : {51U, 64U, 1000U}) {
    CHECK(nearest(index, points[3], k) == all.nearest(points[3], 50));
  }
}

TEST_CASE("Points and queries that are not finite are refused") {
  NeighborIndex index = built(random_points(50, 4));
  for (const float bad : {kNan, kInfinity, -kInfinity}) {
    for (const Point& p :
         {Point{bad, 0, 0, 0}, Point{0, bad, 0, 0}, Point{0, 0, bad, 0}, Point{0, 0, 0, bad}}) {
      const auto added = index.add(p, 1);
      REQUIRE_FALSE(added.has_value());
      CHECK(added.error().code == ErrorCode::kInvalidArgument);
      const auto made = NeighborIndex::build(std::vector<Point>{Point{}, p});
      REQUIRE_FALSE(made.has_value());
      CHECK(made.error().what.find("point 1 ") != std::string::npos);
      CHECK(nearest(index, p, 10).empty());
      std::vector<Neighbor> near{{1, 1}};
      index.within(p, 10, near);
      CHECK(near.empty());
      CHECK_FALSE(index.contains(p, 1));
    }
  }
  CHECK(index.size() == 50);
}

TEST_CASE("A negative or NaN radius finds nothing, an infinite one everything") {
  const NeighborIndex index = built(random_points(500, 4));
  std::vector<Neighbor> near;
  index.within({}, -1.0F, near);
  CHECK(near.empty());
  index.within({}, kNan, near);
  CHECK(near.empty());
  index.within({}, kInfinity, near);
  CHECK(near.size() == 500);
}

TEST_CASE("Distances that overflow are infinite and still ordered by id") {
  std::vector<Point> points(100, Point{-3e38F, 0, 0, 0});
  points[40] = {3e38F, 0, 0, 0};
  const NeighborIndex index = built(points);
  const BruteForce all(points);
  const Point q{3e38F, 1, 0, 0};
  CHECK(nearest(index, q, 10) == all.nearest(q, 10));
  CHECK(nearest(index, q, 100) == all.nearest(q, 100));
  CHECK(nearest(index, q, 10)[1] == Neighbor{kInfinity, 0});
}

TEST_CASE("Ids that do not fit the points are refused") {
  const std::vector<Point> points(3);
  const std::vector<std::uint32_t> ids(2);
  const auto index = NeighborIndex::build(points, ids);
  REQUIRE_FALSE(index.has_value());
  CHECK(index.error().what == "neighbour index: 2 ids for 3 points");
}

TEST_CASE("The distance is summed as documented, incident components first") {
  // 1 + 2^-24 and 2^-24 + 2^-24: another order of summing rounds to another float.
  const float small = std::ldexp(1.0F, -12);
  CHECK(distance_squared({1, small, 0, 0}, {}) == 1.0F);
  CHECK(distance_squared({1, 0, small, small}, {}) == 1.0F + std::ldexp(1.0F, -23));
  // (1 + e)^2 = 1 + 2 e + e^2 with e = 2^-12: a fused product would keep e^2 = 2^-24 in the sum.
  const float a = 1 + small;
  CHECK(distance_squared({a, std::ldexp(1.0F, -12), 0, 0}, {}) == a * a);
}

}  // namespace
}  // namespace scatter::search
