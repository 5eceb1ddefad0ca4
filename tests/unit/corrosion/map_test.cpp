#include "simulator/corrosion/map.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <limits>

namespace scatter::corrosion {
namespace {

TEST_CASE("Map: a map as large as the grid is taken as it is") {
  Map map{8, 8, {}};
  for (int i = 0; i < 64; ++i) {
    map.values.push_back(static_cast<float>(i * 37 % 64) / 64);
  }
  CHECK(on_grid(map, 8) == map.values);
}

TEST_CASE("Map: one value fills the grid") {
  CHECK(on_grid({1, 1, {0.25F}}, 9) == std::vector<float>(81, 0.25F));
}

TEST_CASE("Map: a constant map of many values stays exactly constant") {
  const std::vector<float> grid = on_grid({3, 5, std::vector<float>(15, 0.7F)}, 16);
  CHECK(grid == std::vector<float>(256, 0.7F));
}

TEST_CASE("Map: between samples it is bilinear, and it repeats beyond its borders") {
  // Two columns at 1/4 and 3/4 of the width, one row: cell middles lie at 1/16, 3/16, ...
  const std::vector<float> grid = on_grid({2, 1, {0, 1}}, 8);
  // From the sample at -1/4 (the second one, again) down to the one at 1/4, then up.
  const float expected[] = {0.375F, 0.125F, 0.125F, 0.375F, 0.625F, 0.875F, 0.875F, 0.625F};
  for (std::size_t y = 0; y < 8; ++y) {
    for (std::size_t x = 0; x < 8; ++x) {
      CHECK(grid[y * 8 + x] == Approx(expected[x]));
    }
  }
}

TEST_CASE("Map: rows run from the top and columns from the left") {
  const std::vector<float> grid = on_grid({2, 2, {0, 1, 2, 3}}, 2);
  CHECK(grid == std::vector<float>{0, 1, 2, 3});
}

TEST_CASE("Map: sizes that do not match, NaN and values out of range are refused by name and place") {
  CHECK(check({2, 2, {0, 0, 1, 1}}, "surface", 0, 1));
  const auto refused = [](const Map& map) { return check(map, "surface", 0, 1).error(); };
  CHECK(refused({2, 2, {0, 0, 1}}).what == "surface: 2 x 2 cells have 3 values");
  CHECK(refused({0, 0, {}}).what == "surface: 0 x 0 cells have 0 values");
  CHECK(refused({std::size_t{1} << 63U, 2, {}}).code == ErrorCode::kInvalidArgument);
  const float nan = std::numeric_limits<float>::quiet_NaN();
  CHECK(refused({2, 2, {0, 0, nan, 1}}).what == "surface: column 0, row 1 is nan");
  CHECK(refused({2, 2, {0, 1.5F, 0, 1}}).what == "surface: column 1, row 0 is 1.5");
  CHECK(refused({2, 2, {0, 1, 0, -INFINITY}}).remedy == "give values from 0 to 1");
}

}  // namespace
}  // namespace scatter::corrosion
