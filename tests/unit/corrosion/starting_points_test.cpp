#include "simulator/corrosion/starting_points.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <set>

#include "simulator/corrosion/map.h"
#include "simulator/random/philox.h"
#include "simulator/random/stream.h"

namespace scatter::corrosion {
namespace {

/// 99.9 % quantile of chi squared. Source: Wilson and Hilferty 1931.
double chi_squared_limit(double degrees) {
  const double t = 2 / (9 * degrees);
  return degrees * std::pow(1 - t + 3.0902 * std::sqrt(t), 3);
}

std::vector<float> uneven_weights(std::size_t side) {
  std::vector<float> weights(side * side);
  for (std::size_t y = 0; y < side; ++y) {
    for (std::size_t x = 0; x < side; ++x) {
      weights[y * side + x] =
          (x * 7 + y * 3) % 5 == 0 || y == 4 ? 0 : 0.1F + 0.05F * static_cast<float>(x + 2 * y);
    }
  }
  return weights;
}

TEST_CASE(
    "Starting points: 1e5 draws follow the weights, by rows and by cells, and never hit a weight of 0") {
  constexpr std::size_t kSide = 16;
  constexpr int kDraws = 100000;
  const std::vector<float> weights = uneven_weights(kSide);
  const Places places(weights, kSide);
  simulator::RandomStream random({3, simulator::Purpose::kCorrosion, 77});
  std::vector<int> found(weights.size());
  for (int i = 0; i < kDraws; ++i) {
    const double u = random.uniform();
    ++found[places.at(u, random.uniform())];
  }
  double sum = 0;
  for (const float weight : weights) {
    sum += static_cast<double>(weight);
  }
  double of_cells = 0;
  double of_rows = 0;
  int cells = 0;
  int rows = 0;
  for (std::size_t y = 0; y < kSide; ++y) {
    double row = 0;
    int row_found = 0;
    for (std::size_t i = y * kSide; i < (y + 1) * kSide; ++i) {
      const double expected = static_cast<double>(weights[i]) / sum * kDraws;
      row += expected;
      row_found += found[i];
      if (expected == 0) {
        REQUIRE(found[i] == 0);
        continue;
      }
      of_cells += (found[i] - expected) * (found[i] - expected) / expected;
      ++cells;
    }
    if (row > 0) {
      of_rows += (row_found - row) * (row_found - row) / row;
      ++rows;
    }
  }
  CHECK(places.count() == static_cast<std::size_t>(cells));
  CHECK(of_cells < chi_squared_limit(cells - 1));
  CHECK(of_rows < chi_squared_limit(rows - 1));
}

TEST_CASE("Starting points: the ends of the unit interval stay on cells that have a weight") {
  const std::vector<float> weights = uneven_weights(16);
  const Places places(weights, 16);
  const double last = 1 - 0x1p-53;
  for (const double u : {0.0, last}) {
    for (const double v : {0.0, last}) {
      CHECK(weights[places.at(u, v)] > 0);
    }
  }
  const std::vector<float> even{0.3F};
  CHECK(Places(even, 16).at(0, 0) == 0);
  CHECK(Places(even, 16).at(last, last) == 255);
}

TEST_CASE("Starting points: one weight for all is the same as a map of it") {
  const std::vector<float> one{0.25F};  // Sums without rounding.
  const std::vector<float> many(32 * 32, 0.25F);
  CHECK(*draw_starting_points(one, 32, 5, 1024) == *draw_starting_points(many, 32, 5, 1024));
}

TEST_CASE("Starting points: they are different cells, even when every cell is one") {
  const std::vector<float> weights = uneven_weights(32);
  const Places places(weights, 32);
  const auto all = draw_starting_points(weights, 32, 1, static_cast<std::uint32_t>(places.count()));
  REQUIRE(all);
  CHECK(std::set<std::uint32_t>(all->begin(), all->end()).size() == places.count());
}

TEST_CASE("Starting points: more of them than cells that may corrode are refused by name") {
  const std::vector<float> weights = uneven_weights(16);
  const auto count = static_cast<std::uint32_t>(Places(weights, 16).count());
  const auto refused = draw_starting_points(weights, 16, 1, count + 1);
  REQUIRE(!refused);
  CHECK(refused.error().code == ErrorCode::kInvalidArgument);
  CHECK(refused.error().what.find("starting_points: ") == 0);
  const std::vector<float> nothing(256, 0.0F);
  CHECK(!draw_starting_points(nothing, 16, 1, 1));
}

TEST_CASE(
    "Starting points: point k lies at the same place on a finer grid, and stays when more are asked for") {
  const Map map{
      4, 4, {0.9F, 0.1F, 0.5F, 0.3F, 0.2F, 0.8F, 0.4F, 0.6F, 0.7F, 0.3F, 0.1F, 0.9F, 0.5F, 0.2F, 0.6F, 0.4F}};
  const auto coarse = *draw_starting_points(on_grid(map, 128), 128, 9, 20);
  const auto fine = *draw_starting_points(on_grid(map, 1024), 1024, 9, 30);
  for (std::size_t k = 0; k < 20; ++k) {
    CHECK(coarse[k] / 128 / 128.0 == Approx(fine[k] / 1024 / 1024.0).margin(0.02));
    CHECK(coarse[k] % 128 / 128.0 == Approx(fine[k] % 1024 / 1024.0).margin(0.02));
  }
}

TEST_CASE("Late seeds: gaps are exponential with the mean asked for, and mass never falls") {
  const std::vector<float> one{1.0F};
  const Places places(one, 64);
  LateSeeds seeds(places, 4, 20);
  double last = 0;
  double sum = 0;
  double sum2 = 0;
  constexpr int kSeeds = 20000;
  for (int i = 0; i < kSeeds; ++i) {
    const double gap = seeds.next().mass_g_per_m2 - last;
    REQUIRE(gap >= 0);
    last = seeds.next().mass_g_per_m2;
    sum += gap;
    sum2 += gap * gap;
    seeds.advance();
  }
  // 20 per 1000 g/m^2: mean 50, and as large a standard deviation; four standard errors.
  const double mean = sum / kSeeds;
  CHECK(mean == Approx(50).margin(4 * 50 / std::sqrt(kSeeds)));
  CHECK(std::sqrt(sum2 / kSeeds - mean * mean) == Approx(50).epsilon(0.04));
}

TEST_CASE("Late seeds: none come when none are asked for or nothing may corrode") {
  const std::vector<float> one{1.0F};
  const std::vector<float> nothing{0.0F};
  const Places places(one, 64);
  const Places bare(nothing, 64);
  CHECK(std::isinf(LateSeeds(places, 4, 0).next().mass_g_per_m2));
  CHECK(std::isinf(LateSeeds(bare, 4, 10).next().mass_g_per_m2));
}

}  // namespace
}  // namespace scatter::corrosion
