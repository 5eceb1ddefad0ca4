// Mode::kPhysical: the same sheet on finer grids (issue 4; check 10 of corrosion.md 5.1).
#include <catch2/catch.hpp>

#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include "simulator/corrosion/growth.h"

namespace scatter::corrosion {
namespace {

/// Variance over 50 x 50 positions of the mean of `value` over a disc 3 mm wide.
template <typename Value>
double spot_variance(const Sheet& sheet, Value value) {
  constexpr std::size_t kPositions = 50;
  constexpr double kRadiusMm = 1.5;
  const std::size_t side = sheet.side;
  // Running sums along each row, twice round, so that a disc's rows are differences.
  const std::size_t stride = 2 * side + 1;
  std::vector<double> sums(side * stride, 0.0);
  for (std::size_t y = 0; y < side; ++y) {
    for (std::size_t x = 0; x < 2 * side; ++x) {
      sums[y * stride + x + 1] = sums[y * stride + x] + value(y * side + x % side);
    }
  }
  double mean = 0;
  double square = 0;
  for (std::size_t k = 0; k < kPositions * kPositions; ++k) {
    const double middle_x =
        (static_cast<double>(k % kPositions) + 0.5) * static_cast<double>(side) / kPositions;
    const double middle_y =
        (static_cast<double>(k / kPositions) + 0.5) * static_cast<double>(side) / kPositions;
    double sum = 0;
    double cells = 0;
    for (std::size_t y = 0; y < side; ++y) {
      double dy = std::abs(static_cast<double>(y) + 0.5 - middle_y);
      dy = std::min(dy, static_cast<double>(side) - dy) * sheet.cell_mm();
      if (dy >= kRadiusMm) {
        continue;
      }
      const double half = std::sqrt(kRadiusMm * kRadiusMm - dy * dy) / sheet.cell_mm();
      const double begin = middle_x < half ? middle_x + static_cast<double>(side) : middle_x;
      const auto from = static_cast<std::size_t>(std::ceil(begin - half - 0.5));
      const auto to = static_cast<std::size_t>(std::floor(begin + half - 0.5)) + 1;
      sum += sums[y * stride + to] - sums[y * stride + from];
      cells += static_cast<double>(to - from);
    }
    mean += sum / cells / (kPositions * kPositions);
    square += sum / cells * sum / cells / (kPositions * kPositions);
  }
  return square - mean * mean;
}

struct Figures {
  double corroded = 0;
  double holes = 0;
  double height_variance = 0;
  double corroded_variance = 0;
};

Figures figures(Corrosivity corrosivity, double age, std::size_t side) {
  GrowthOptions options;
  options.corrosivity = corrosivity;
  options.age_years = age;
  options.side = side;
  const auto growth = Growth::run(options);
  REQUIRE(growth);
  const Sheet sheet = (*growth)->at(age).value();
  return {.corroded = sheet.corroded_fraction,
          .holes = sheet.hole_fraction,
          .height_variance =
              spot_variance(sheet, [&](std::size_t i) { return static_cast<double>(sheet.height[i]); }),
          .corroded_variance = spot_variance(
              sheet, [&](std::size_t i) { return sheet.state[i] >= CellState::kSpreading ? 1.0 : 0.0; })};
}

TEST_CASE(
    "Physical: fractions and spot variance agree within 3 % on 512, 1024 and 2048 cells a side, with holes") {
  const Figures finest = figures(Corrosivity::kVeryHigh, 10, 2048);
  CHECK(finest.holes > 0.02);
  for (const std::size_t side : {512U, 1024U}) {
    INFO(side << " cells");
    const Figures coarse = figures(Corrosivity::kVeryHigh, 10, side);
    CHECK(coarse.corroded == Approx(finest.corroded).epsilon(0.03));
    CHECK(coarse.holes == Approx(finest.holes).epsilon(0.03));
    CHECK(coarse.height_variance == Approx(finest.height_variance).epsilon(0.03));
  }
}

TEST_CASE(
    "Physical: they also agree within 3 % where rust covers two thirds, and the corroded share of spots "
    "too") {
  const Figures finest = figures(Corrosivity::kMedium, 25, 1024);
  const Figures coarse = figures(Corrosivity::kMedium, 25, 512);
  CHECK(coarse.corroded == Approx(finest.corroded).epsilon(0.03));
  CHECK(coarse.holes == Approx(finest.holes).epsilon(0.03));
  CHECK(coarse.height_variance == Approx(finest.height_variance).epsilon(0.03));
  CHECK(coarse.corroded_variance == Approx(finest.corroded_variance).epsilon(0.03));
}

}  // namespace
}  // namespace scatter::corrosion
