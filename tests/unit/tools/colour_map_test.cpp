#include "tools/plot/colour_map.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>

using namespace scatter::plot;

TEST_CASE("Equal steps of the colour map look equally large") {
  const auto& map = colour_map();
  std::vector<double> steps;
  for (std::size_t k = 1; k < map.size(); ++k) {
    const OkLab a = to_oklab(map[k - 1]);
    const OkLab b = to_oklab(map[k]);
    steps.push_back(
        std::hypot(a.lightness - b.lightness, a.green_red - b.green_red, a.blue_yellow - b.blue_yellow));
  }
  const auto [least, most] = std::ranges::minmax(steps);
  // Arc length from 16384 chords: the table's own rounding stays far below 1 %.
  CHECK(most / least < 1.01);
}

TEST_CASE("Lightness of the colour map rises all the way, from dark to light, inside sRGB") {
  const auto& map = colour_map();
  for (std::size_t k = 0; k < map.size(); ++k) {
    for (const double component : {map[k].r, map[k].g, map[k].b}) {
      REQUIRE(component >= 0);
      REQUIRE(component <= 1);
    }
    if (k > 0) {
      REQUIRE(to_oklab(map[k]).lightness > to_oklab(map[k - 1]).lightness);
    }
  }
  CHECK(to_oklab(map.front()).lightness == Approx(0.17).margin(1e-3));
  CHECK(to_oklab(map.back()).lightness == Approx(0.96).margin(1e-3));
}

TEST_CASE("OKLab of the sRGB primaries is that of its author") {
  // Ottosson 2020, test values for white; red from his reference implementation to 3 decimals.
  const OkLab white = to_oklab({1, 1, 1});
  CHECK(white.lightness == Approx(1).margin(1e-4));
  CHECK(white.green_red == Approx(0).margin(1e-4));
  CHECK(white.blue_yellow == Approx(0).margin(1e-4));
  const OkLab red = to_oklab({1, 0, 0});
  CHECK(red.lightness == Approx(0.628).margin(1e-3));
  CHECK(red.green_red == Approx(0.225).margin(1e-3));
  CHECK(red.blue_yellow == Approx(0.126).margin(1e-3));
}

TEST_CASE("Values outside the scale take the map's ends") {
  CHECK(map_colour(-3).r == colour_map().front().r);
  CHECK(map_colour(std::nan("")).r == colour_map().front().r);
  CHECK(map_colour(7).r == colour_map().back().r);
}
