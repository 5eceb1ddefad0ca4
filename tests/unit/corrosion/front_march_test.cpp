// Expected values: distances, Fermat's principle and the closed form for a constant gradient of speed.
#include "simulator/corrosion/front_march.h"

#include <catch2/catch.hpp>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <random>
#include <set>
#include <vector>

namespace scatter::corrosion {
namespace {

constexpr float kNever = std::numeric_limits<float>::infinity();

TEST_CASE("The queue gives the least key first, whatever was put in between") {
  std::mt19937 source(3);
  const auto random = [&source] { return static_cast<std::uint32_t>(source()); };
  RadixQueue queue;
  std::multiset<std::uint32_t> expected;
  std::uint32_t now = 0;
  for (int round = 0; round < 20000; ++round) {
    for (std::uint32_t k = random() % 3; k > 0; --k) {
      const std::uint32_t key = now + (random() >> (8 + random() % 20));
      queue.push({.key = key, .value = key ^ 5U});
      expected.insert(key);
    }
    const std::uint32_t limit = now + (random() >> (10 + random() % 20));
    while (!expected.empty() && *expected.begin() < limit) {
      REQUIRE(queue.has_below(limit));
      const RadixQueue::Entry entry = queue.pop();
      REQUIRE(entry.key == *expected.begin());
      REQUIRE(entry.value == (entry.key ^ 5U));
      expected.erase(expected.begin());
    }
    REQUIRE_FALSE(queue.has_below(limit));
    REQUIRE(queue.empty() == expected.empty());
    now = limit;
  }
}

double step_between(std::size_t a, std::size_t b, std::size_t side) {
  const double way = std::abs(static_cast<double>(a) - static_cast<double>(b));
  return std::min(way, static_cast<double>(side) - way);
}

/// Greatest error [cells] of the distance from a cell on a torus.
double circle_error(std::size_t side) {
  FrontMarch march(std::vector<float>(side * side, 1.0F), side, 1.0, Border::kToroidal);
  const std::size_t x0 = side / 3;
  const std::size_t y0 = side - 2;
  march.start(static_cast<std::uint32_t>(y0 * side + x0), 0);
  CHECK(march.advance(1e9F).size() == side * side);
  CHECK(march.done());
  double worst = 0;
  for (std::size_t y = 0; y < side; ++y) {
    for (std::size_t x = 0; x < side; ++x) {
      const double distance = std::hypot(step_between(x, x0, side), step_between(y, y0, side));
      worst = std::max(worst, std::abs(static_cast<double>(march.times()[y * side + x]) - distance));
    }
  }
  return worst;
}

// Second-order stencils see too little slope where a front is strongly curved, within some cells of a point:
// it gets away up to 0.6 cells early, and keeps that lead. The error does not grow with distance.
TEST_CASE("A front in even metal is a circle to 0.6 cells, across the borders of a torus too") {
  for (const std::size_t side : {64U, 256U, 512U}) {
    CHECK(circle_error(side) < 0.6);
  }
}

TEST_CASE("A front in a constant gradient of speed arrives when the closed form says") {
  // Speed v = 1 + g y: T = acosh(1 + g^2 d^2 / (2 v1 v2)) / g (rays are arcs of circles).
  const double extent = 10;
  const double g = 0.3;
  std::vector<double> errors;
  for (const std::size_t side : {64U, 128U, 256U}) {
    const double cell = extent / static_cast<double>(side);
    std::vector<float> slowness(side * side);
    const auto middle = [&](std::size_t i) { return (static_cast<double>(i) + 0.5) * cell; };
    for (std::size_t i = 0; i < slowness.size(); ++i) {
      slowness[i] = static_cast<float>(1 / (1 + g * middle(i / side)));
    }
    FrontMarch march(slowness, side, cell, Border::kClamped);
    const std::size_t x0 = side / 2;
    const std::size_t y0 = side / 4;
    march.start(static_cast<std::uint32_t>(y0 * side + x0), 0);
    march.advance(1e9F);
    double worst = 0;
    for (std::size_t y = 0; y < side; ++y) {
      for (std::size_t x = 0; x < side; ++x) {
        const double d2 = std::pow(middle(x) - middle(x0), 2) + std::pow(middle(y) - middle(y0), 2);
        const double expected =
            std::acosh(1 + g * g * d2 / (2 * (1 + g * middle(y0)) * (1 + g * middle(y)))) / g;
        worst = std::max(worst, std::abs(static_cast<double>(march.times()[y * side + x]) - expected));
      }
    }
    errors.push_back(worst);
  }
  // The lead of 0.6 cells of 10 / 64 mm at the speed beside the point, 1 + 0.3 * 2.5.
  CHECK(errors[0] < 0.6 * 10 / 64 / 1.75);
  CHECK(errors[1] < errors[0] / 1.8);
  CHECK(errors[2] < errors[1] / 1.8);
}

TEST_CASE("A front that enters quicker metal takes the quickest way, and comes back along the border") {
  constexpr std::size_t kSide = 256;
  std::vector<float> slowness(kSide * kSide, 1.0F);
  for (std::size_t y = 0; y < kSide; ++y) {
    std::fill_n(slowness.begin() + static_cast<std::ptrdiff_t>(y * kSide + 128), 128, 0.5F);
  }
  FrontMarch march(slowness, kSide, 1.0, Border::kClamped);
  march.start(128 * kSide + 90, 0);
  march.advance(1e9F);
  // The border of the two metals lies half a cell before column 128.
  const double to_border = 127.5 - 90;
  for (const int dy : {0, 20, 60, 110, -100}) {
    for (const int dx : {1, 10, 50, 100}) {
      double expected = 1e9;
      for (double crossing = -130; crossing <= 130; crossing += 0.01) {
        expected = std::min(expected, std::hypot(to_border, crossing) +
                                          0.5 * std::hypot(dx - 0.5, static_cast<double>(dy) - crossing));
      }
      INFO("quick side " << dx << ", " << dy);
      CHECK(static_cast<double>(march.times()[static_cast<std::size_t>(128 + dy) * kSide + 127 +
                                              static_cast<std::size_t>(dx)]) == Approx(expected).margin(1));
    }
    for (const int dx : {-2, -20, -60}) {
      // Straight there, or along the border at double speed, met and left at 30 degrees to its normal.
      const double own = 0.5 - static_cast<double>(dx);
      const double straight = std::hypot(static_cast<double>(dx) - 0.5 + to_border, static_cast<double>(dy));
      const double critical = std::asin(0.5);
      const bool reaches = std::abs(dy) >= (to_border + own) * std::tan(critical);
      const double along = std::abs(dy) * 0.5 + (to_border + own) * std::cos(critical);
      INFO("slow side " << dx << ", " << dy);
      CHECK(static_cast<double>(march.times()[static_cast<std::size_t>(128 + dy) * kSide +
                                              static_cast<std::size_t>(128 + dx)]) ==
            Approx(reaches ? std::min(straight, along) : straight).margin(2));
    }
  }
}

TEST_CASE("A front goes round what it may not enter") {
  constexpr std::size_t kSide = 101;
  std::vector<float> slowness(kSide * kSide, 1.0F);
  for (std::size_t y = 0; y < 70; ++y) {
    slowness[y * kSide + 50] = kNever;
  }
  FrontMarch march(slowness, kSide, 1.0, Border::kClamped);
  march.start(30 * kSide + 30, 0);
  CHECK(march.advance(1e9F).size() == kSide * kSide - 70);
  for (std::size_t y = 0; y < 70; ++y) {
    CHECK(march.times()[y * kSide + 50] == kNever);
  }
  // By way of the wall's end, whose corner lies between rows 69 and 70.
  const double round = std::hypot(20.0, 39.5) * 2;
  CHECK(static_cast<double>(march.times()[30 * kSide + 70]) == Approx(round).margin(1.5));
}

TEST_CASE("A clamped front does not come in from the other side") {
  FrontMarch march(std::vector<float>(64 * 64, 1.0F), 64, 1.0, Border::kClamped);
  march.start(0, 0);
  march.advance(1e9F);
  CHECK(static_cast<double>(march.times()[63]) == Approx(63).margin(0.5));
  CHECK(static_cast<double>(march.times()[63 * 64 + 63]) == Approx(63 * std::sqrt(2)).margin(0.5));
}

TEST_CASE("A march in many pieces is the march in one, each cell reported once and in order") {
  std::mt19937 random(5);
  std::vector<float> slowness(100 * 100);
  for (float& value : slowness) {
    value = 0.2F + static_cast<float>(random() % 1000) / 500;
  }
  FrontMarch whole(slowness, 100, 0.5, Border::kToroidal);
  FrontMarch pieces(slowness, 100, 0.5, Border::kToroidal);
  whole.start(4711, 0);
  pieces.start(4711, 0);
  whole.advance(1e9F);
  std::vector<std::uint32_t> order;
  for (float limit = 0.03F; !pieces.done(); limit += 0.03F) {
    for (const std::uint32_t cell : pieces.advance(limit)) {
      REQUIRE(pieces.times()[cell] < limit);
      REQUIRE(pieces.times()[cell] >= limit - 0.031F);
      order.push_back(cell);
    }
  }
  CHECK(order.size() == slowness.size());
  CHECK(std::ranges::is_sorted(order, {}, [&](std::uint32_t cell) { return whole.times()[cell]; }));
  CHECK(std::ranges::equal(whole.times(), pieces.times()));
}

TEST_CASE("A later start meets the first front half way, and does nothing where that has been") {
  FrontMarch march(std::vector<float>(128 * 128, 1.0F), 128, 1.0, Border::kClamped);
  march.start(64 * 128 + 20, 0);
  march.advance(10);
  march.start(64 * 128 + 25, 10);
  march.start(64 * 128 + 100, 10);
  march.advance(1e9F);
  const auto at = [&](std::size_t x) { return static_cast<double>(march.times()[64 * 128 + x]); };
  CHECK(at(25) == Approx(5).margin(0.5));
  CHECK(at(100) == 10);
  CHECK(at(64) == Approx(44).margin(0.5));
  CHECK(at(66) == Approx(10 + 34).margin(0.5));
  CHECK(at(90) == Approx(20).margin(0.5));
}

}  // namespace
}  // namespace scatter::corrosion
