// Expected values: distances by search over all cells; the formulas of corrosion.md 1.11.
#include "simulator/corrosion/exposure.h"

#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <random>
#include <vector>

namespace scatter::corrosion {
namespace {

double searched_distance(const Map& mask, double extent, Border border, std::size_t x, std::size_t y) {
  const double step_x = extent / static_cast<double>(mask.width);
  const double step_y = extent / static_cast<double>(mask.height);
  double best = std::numeric_limits<double>::infinity();
  for (std::size_t v = 0; v < mask.height; ++v) {
    for (std::size_t u = 0; u < mask.width; ++u) {
      if (mask.values[v * mask.width + u] < 0.5F) {
        continue;
      }
      double dx = std::abs(static_cast<double>(u) - static_cast<double>(x)) * step_x;
      double dy = std::abs(static_cast<double>(v) - static_cast<double>(y)) * step_y;
      if (border == Border::kToroidal) {
        dx = std::min(dx, extent - dx);
        dy = std::min(dy, extent - dy);
      }
      best = std::min(best, std::hypot(dx, dy));
    }
  }
  return std::max(best - std::min(step_x, step_y) / 2, 0.0);
}

TEST_CASE("Distances are exact, on a torus and on a sheet with borders, also where cells are not square") {
  std::mt19937 random(2);
  for (const Border border : {Border::kToroidal, Border::kClamped}) {
    for (int round = 0; round < 20; ++round) {
      Map mask{17, 29, std::vector<float>(17 * 29)};
      for (float& value : mask.values) {
        value = random() % 60 == 0 ? 1.0F : 0.0F;
      }
      mask.values[random() % mask.values.size()] = 0.5F;
      const Map distance = distance_to(mask, 10, border);
      for (std::size_t y = 0; y < 29; ++y) {
        for (std::size_t x = 0; x < 17; ++x) {
          REQUIRE(static_cast<double>(distance.values[y * 17 + x]) ==
                  Approx(searched_distance(mask, 10, border, x, y)).margin(1e-5));
        }
      }
    }
  }
}

TEST_CASE("Nothing is near an empty mask") {
  const Map distance = distance_to(Map{3, 2, std::vector<float>(6, 0.0F)}, 10, Border::kToroidal);
  CHECK(std::ranges::all_of(distance.values, [](float value) { return std::isinf(value); }));
}

Map left_half(std::size_t side) {
  Map mask{side, side, std::vector<float>(side * side, 0.0F)};
  for (std::size_t y = 0; y < side; ++y) {
    std::fill_n(mask.values.begin() + static_cast<std::ptrdiff_t>(y * side), side / 2, 1.0F);
  }
  return mask;
}

TEST_CASE("A cover spares what is below it and harms what is beside it") {
  const AerationOptions options{.covered = 0.1, .edge_gain = 4, .reach_mm = 5};
  const Map exposure = aeration_exposure(left_half(100), 100, Border::kClamped, options).value();
  CHECK(exposure.values[10] == 0.1F);
  for (const std::size_t x : {50U, 55U, 70U, 99U}) {
    // Cells of 1 mm: the edge is at 50 mm, the middle of cell x at x + 0.5.
    const double distance = static_cast<double>(x) + 0.5 - 50;
    CHECK(static_cast<double>(exposure.values[x]) == Approx(1 + 4 * std::exp(-distance / 5)));
  }
}

TEST_CASE("A nobler metal does not corrode; what it touches does by the ratio of areas") {
  const GalvanicOptions options{.contact_gain = 3, .reach_mm = 5};
  const Map half = galvanic_exposure(left_half(100), 100, Border::kClamped, options).value();
  CHECK(half.values[10] == 0);
  CHECK(static_cast<double>(half.values[50]) == Approx(1 + 3 * std::exp(-0.5 / 5)));
  Map most = left_half(100);
  for (std::size_t y = 0; y < 100; ++y) {
    std::fill_n(most.values.begin() + static_cast<std::ptrdiff_t>(y * 100), 75, 1.0F);
  }
  const Map strong = galvanic_exposure(most, 100, Border::kClamped, options).value();
  CHECK(static_cast<double>(strong.values[75]) == Approx(1 + 9 * std::exp(-0.5 / 5)));
}

TEST_CASE("Exposures multiply, also with a constant") {
  const Map two{2, 1, {2.0F, 3.0F}};
  CHECK(product(two, Map{1, 1, {2.0F}}).value().values == std::vector<float>{4.0F, 6.0F});
  CHECK(product(Map{1, 1, {2.0F}}, two).value().values == std::vector<float>{4.0F, 6.0F});
  CHECK(product(two, two).value().values == std::vector<float>{4.0F, 9.0F});
  const auto wrong = product(two, Map{1, 2, {1.0F, 1.0F}});
  REQUIRE_FALSE(wrong);
  CHECK(wrong.error().what.find("2 x 1") != std::string::npos);
}

TEST_CASE("Bad masks and numbers are refused by name") {
  const Map mask = left_half(8);
  const auto what = [](const Result<Map>& result) {
    return result ? std::string("accepted") : result.error().what;
  };
  Map broken = mask;
  broken.values[3] = std::numeric_limits<float>::quiet_NaN();
  CHECK(what(aeration_exposure(broken, 50, Border::kToroidal)).find("cover") == 0);
  CHECK(what(galvanic_exposure(broken, 50, Border::kToroidal)).find("contact") == 0);
  CHECK(what(aeration_exposure(mask, 0, Border::kToroidal)).find("extent_mm") == 0);
  CHECK(what(aeration_exposure(mask, 50, Border::kToroidal, {.covered = 2})).find("covered") == 0);
  CHECK(what(aeration_exposure(mask, 50, Border::kToroidal, {.edge_gain = -1})).find("edge_gain") == 0);
  CHECK(what(aeration_exposure(mask, 50, Border::kToroidal, {.reach_mm = 0})).find("reach_mm") == 0);
  CHECK(what(galvanic_exposure(mask, 50, Border::kToroidal, {.contact_gain = 1e9})).find("contact_gain") ==
        0);
  CHECK(what(galvanic_exposure(Map{1, 1, {1.0F}}, 50, Border::kToroidal)).find("contact") == 0);
}

}  // namespace
}  // namespace scatter::corrosion
