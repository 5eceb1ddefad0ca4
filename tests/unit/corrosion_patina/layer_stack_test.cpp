// Operators on layers: what is added is there, what is taken is gone, nothing else moves.
#include "simulator/corrosion/patina/layer_stack.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>

#include "simulator/corrosion/patina/rolling_ball.h"
#include "simulator/random/stream.h"

namespace scatter::corrosion {
namespace {

constexpr std::size_t kSide = 24;
constexpr std::size_t kCells = kSide * kSide;

std::vector<float> random_map(std::uint64_t seed, double highest) {
  simulator::RandomStream stream({seed, simulator::Purpose::kPatina, 1});
  std::vector<float> map(kCells);
  std::ranges::generate(map, [&] { return static_cast<float>(highest * stream.uniform()); });
  return map;
}

double mean(const std::vector<float>& map) {
  double sum = 0;
  for (const float value : map) {
    sum += value;
  }
  return sum / static_cast<double>(map.size());
}

LayerStack two_layers() {
  LayerStack stack = *LayerStack::bare(kSide, 2.4, random_map(1, 1));
  REQUIRE(stack.coat(PatinaMaterial::kTarnish, random_map(2, 2)));
  REQUIRE(stack.coat(PatinaMaterial::kSulphate, random_map(3, 5)));
  return stack;
}

TEST_CASE("Coating adds exactly the map, on top") {
  LayerStack stack = *LayerStack::bare(kSide, 2.4, random_map(1, 1));
  const std::vector<float> bare = stack.surface_um();
  const std::vector<float> first = random_map(2, 2);
  const std::vector<float> second = random_map(3, 5);
  CHECK(*stack.coat(PatinaMaterial::kTarnish, first) == Approx(mean(first)));
  CHECK(*stack.coat(PatinaMaterial::kSulphate, second) == Approx(mean(second)));
  REQUIRE(stack.layers().size() == 2);
  CHECK(stack.layers()[0].material == PatinaMaterial::kTarnish);
  CHECK(stack.layers()[0].thickness_um == first);
  CHECK(stack.layers()[1].material == PatinaMaterial::kSulphate);
  CHECK(stack.layers()[1].thickness_um == second);
  const std::vector<float> surface = stack.surface_um();
  for (std::size_t i = 0; i < kCells; ++i) {
    REQUIRE(surface[i] == Approx(bare[i] + first[i] + second[i]).epsilon(1e-6));
  }
}

TEST_CASE("Coating twice with one material thickens one layer; another material between makes three") {
  LayerStack stack = two_layers();
  const std::vector<float> more = random_map(4, 1);
  REQUIRE(stack.coat(PatinaMaterial::kSulphate, more));
  CHECK(stack.layers().size() == 2);
  REQUIRE(stack.coat(PatinaMaterial::kTarnish, more));
  REQUIRE(stack.layers().size() == 3);
  CHECK(stack.layers()[2].material == PatinaMaterial::kTarnish);
  CHECK(stack.mean_um(PatinaMaterial::kTarnish) == Approx(mean(random_map(2, 2)) + mean(more)));
}

TEST_CASE("Eroding takes the map or all there is, from the top downward, and no metal") {
  LayerStack stack = two_layers();
  const LayerStack before = stack;
  const std::vector<float> depth = random_map(5, 9);
  const double taken = *stack.erode(depth);
  double expected = 0;
  for (std::size_t i = 0; i < kCells; ++i) {
    const float tarnish = before.layers()[0].thickness_um[i];
    const float green = before.layers()[1].thickness_um[i];
    expected += std::min(depth[i], tarnish + green);
    REQUIRE(stack.layers()[1].thickness_um[i] == Approx(std::max(0.0F, green - depth[i])).margin(1e-6));
    REQUIRE(stack.layers()[0].thickness_um[i] ==
            Approx(std::clamp(tarnish + green - depth[i], 0.0F, tarnish)).margin(1e-6));
    REQUIRE(stack.metal_um()[i] == before.metal_um()[i]);
  }
  CHECK(taken == Approx(expected / kCells));
  CHECK(*stack.erode(std::vector<float>(kCells, 1e6F)) > 0);
  CHECK(*stack.erode(std::vector<float>(kCells, 1e6F)) == 0);
  CHECK(stack.surface_um() == std::vector<float>(before.metal_um().begin(), before.metal_um().end()));
}

TEST_CASE("Layers keep their order through every operator") {
  LayerStack stack = two_layers();
  REQUIRE(stack.erode(std::vector<float>(kCells, 100.0F)));
  REQUIRE(stack.fill(PatinaMaterial::kChloride, 0.5));
  REQUIRE(stack.polish(0.4));
  REQUIRE(stack.offset(PatinaMaterial::kTarnish, 50));
  REQUIRE(stack.layers().size() == 4);
  CHECK(stack.layers()[0].material == PatinaMaterial::kTarnish);
  CHECK(stack.layers()[1].material == PatinaMaterial::kSulphate);
  CHECK(stack.layers()[2].material == PatinaMaterial::kChloride);
  CHECK(stack.layers()[3].material == PatinaMaterial::kTarnish);
}

TEST_CASE("Filling leaves nothing below the level and what was above it alone; doing it again adds nothing") {
  LayerStack stack = two_layers();
  const std::vector<float> before = stack.surface_um();
  const double added = *stack.fill(PatinaMaterial::kSulphate, 3.0);
  const std::vector<float> after = stack.surface_um();
  double expected = 0;
  for (std::size_t i = 0; i < kCells; ++i) {
    expected += std::max(0.0F, 3.0F - before[i]);
    REQUIRE(after[i] == Approx(std::max(3.0F, before[i])).epsilon(1e-6));
  }
  CHECK(added == Approx(expected / kCells));
  CHECK(*stack.fill(PatinaMaterial::kSulphate, 3.0) == Approx(0).margin(1e-6));
}

TEST_CASE(
    "Polishing leaves nothing above the level and what was below it alone; doing it again takes nothing") {
  for (const double level : {3.0, 0.3}) {  // The lower one cuts metal as well.
    LayerStack stack = two_layers();
    const std::vector<float> before = stack.surface_um();
    const double taken = *stack.polish(level);
    const std::vector<float> after = stack.surface_um();
    double expected = 0;
    for (std::size_t i = 0; i < kCells; ++i) {
      expected += std::max(0.0, before[i] - level);
      REQUIRE(after[i] == Approx(std::min(level, static_cast<double>(before[i]))).margin(2e-6));
    }
    CHECK(taken == Approx(expected / kCells));
    CHECK(*stack.polish(level) == Approx(0).margin(1e-6));
  }
}

TEST_CASE("Offsetting a flat surface, and any surface by a ball finer than the cells, changes nothing") {
  LayerStack flat = *LayerStack::bare(kSide, 2.4);
  REQUIRE(flat.coat(PatinaMaterial::kTarnish, std::vector<float>(kCells, 2.5F)));
  CHECK(*flat.offset(PatinaMaterial::kTarnish, 1e4) == 0);
  LayerStack rough = two_layers();  // Cells of 100 um.
  CHECK(*rough.offset(PatinaMaterial::kTarnish, 90) == 0);
}

TEST_CASE("Offsetting fills narrow pits as deep as the ball cannot sink, and leaves wide ones") {
  // Ditches of 100 um depth across 10 um cells: the ball sinks r - sqrt(r^2 - w^2) between edges 2 w apart.
  constexpr std::size_t kLine = 64;
  constexpr double kRadius = 60;
  std::vector<float> ditch(kLine * kLine, 100.0F);
  for (std::size_t y = 0; y < kLine; ++y) {
    ditch[y * kLine + 10] = ditch[y * kLine + 11] = ditch[y * kLine + 12] = 0;  // Edges 40 um apart.
    std::fill_n(ditch.begin() + static_cast<long>(y * kLine + 30), 25, 0.0F);   // 260 um.
  }
  const std::vector<float> closed = closed_by_ball(ditch, kLine, 10, kRadius);
  CHECK(closed[11] == Approx(100 - (kRadius - std::sqrt(kRadius * kRadius - 20 * 20))).epsilon(1e-4));
  CHECK(closed[5] == 100);
  CHECK(closed[42] == 0);
  for (std::size_t i = 0; i < closed.size(); ++i) {
    REQUIRE(closed[i] >= ditch[i]);
  }
}

TEST_CASE("Offsetting twice is offsetting once, across the border as inside") {
  LayerStack stack = *LayerStack::bare(kSide, 0.024, random_map(7, 4));  // Cells of 1 um, relief of 4.
  const std::vector<float> before = stack.surface_um();
  std::vector<float> shifted(kCells);
  for (std::size_t i = 0; i < kCells; ++i) {
    const std::size_t x = i % kSide;
    const std::size_t y = i / kSide;
    shifted[(y + 5) % kSide * kSide + (x + 9) % kSide] = before[i];
  }
  CHECK(*stack.offset(PatinaMaterial::kTarnish, 6) > 0.1);
  const std::vector<float> once = stack.surface_um();
  CHECK(*stack.offset(PatinaMaterial::kTarnish, 6) == Approx(0).margin(1e-5));
  LayerStack moved = *LayerStack::bare(kSide, 0.024, shifted);
  REQUIRE(moved.offset(PatinaMaterial::kTarnish, 6));
  const std::vector<float> elsewhere = moved.surface_um();
  for (std::size_t i = 0; i < kCells; ++i) {
    REQUIRE(elsewhere[(i / kSide + 5) % kSide * kSide + (i % kSide + 9) % kSide] ==
            Approx(once[i]).margin(1e-5));
  }
}

TEST_CASE("A map of the wrong size, negative or not a number is refused and changes nothing") {
  LayerStack stack = two_layers();
  const std::vector<float> before = stack.surface_um();
  std::vector<float> bad(kCells, 1.0F);
  CHECK(stack.coat(PatinaMaterial::kTarnish, std::vector<float>(3)).error().what ==
        "coat has 3 values, expected 576");
  bad[5] = -1;
  CHECK(stack.erode(bad).error().what == "erode: cell 5 is -1, expected 0..1e6 [um]");
  bad[5] = std::numeric_limits<float>::quiet_NaN();
  CHECK(stack.coat(PatinaMaterial::kTarnish, bad).error().code == ErrorCode::kInvalidArgument);
  CHECK_FALSE(stack.fill(PatinaMaterial::kTarnish, std::numeric_limits<double>::infinity()));
  CHECK_FALSE(stack.polish(std::numeric_limits<double>::quiet_NaN()));
  CHECK_FALSE(stack.offset(PatinaMaterial::kTarnish, -1));
  CHECK_FALSE(stack.fill(PatinaMaterial::kTarnish, 1e300));
  CHECK_FALSE(stack.offset(PatinaMaterial::kTarnish, 1e5));
  CHECK(stack.surface_um() == before);
  CHECK(stack.layers().size() == 2);
  CHECK_FALSE(LayerStack::bare(0, 1));
  CHECK_FALSE(LayerStack::bare(8, 0));
  CHECK_FALSE(LayerStack::bare(8, 1, bad));
}

}  // namespace
}  // namespace scatter::corrosion
