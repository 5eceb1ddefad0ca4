// Rates of steady thickening between scattered seeds.
#include "simulator/corrosion/patina/seed_field.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>

namespace scatter::corrosion {
namespace {

constexpr std::size_t kSide = 256;

SeedField field(std::uint64_t seed) {
  return {.extent_mm = 50, .spacing_mm = 5, .sigma = 0.4, .seed = seed};
}

double variance_of_log(const std::vector<float>& values) {
  double sum = 0;
  double sum2 = 0;
  for (const float value : values) {
    sum += std::log(value);
    sum2 += std::log(value) * std::log(value);
  }
  const auto n = static_cast<double>(values.size());
  return sum2 / n - sum / n * (sum / n);
}

TEST_CASE("Local rates are above 0 with mean 1, and 1 everywhere without spread") {
  const std::vector<float> values = on_grid(field(1), kSide);
  double sum = 0;
  for (const float value : values) {
    REQUIRE(value > 0);
    sum += value;
  }
  CHECK(sum / static_cast<double>(values.size()) == Approx(1).epsilon(1e-5));
  SeedField even = field(1);
  even.sigma = 0;
  CHECK(on_grid(even, 32) == std::vector<float>(32 * 32, 1.0F));
}

TEST_CASE("Interpolation stays within the seeds' spread") {
  // One scale of sigma 0.4: a weighted mean has less variance than what it is a mean of, and far more than
  // none.
  SeedField one = field(2);
  one.scales = 1;
  const double variance = variance_of_log(on_grid(one, kSide));
  CHECK(variance < 0.16);
  CHECK(variance > 0.04);
}

TEST_CASE("The field has no seam: steps across the border are like those inside") {
  const std::vector<float> values = on_grid(field(3), kSide);
  double across = 0;
  double inside = 0;
  for (std::size_t y = 0; y < kSide; ++y) {
    across += std::abs(values[y * kSide] - values[y * kSide + kSide - 1]);
    for (std::size_t x = 1; x < kSide; ++x) {
      inside += std::abs(values[y * kSide + x] - values[y * kSide + x - 1]) / (kSide - 1);
    }
  }
  CHECK(across / inside > 0.6);
  CHECK(across / inside < 1.6);
}

TEST_CASE("The same continuous field lies under every grid") {
  // A coarse cell's middle lies between four fine ones; fields of 5 mm and finer change little in 0.1 mm.
  SeedField smooth = field(4);
  smooth.scales = 2;
  const std::vector<float> coarse = on_grid(smooth, kSide);
  const std::vector<float> fine = on_grid(smooth, 2 * kSide);
  for (std::size_t y = 0; y < kSide; ++y) {
    for (std::size_t x = 0; x < kSide; ++x) {
      const std::size_t corner = 2 * y * 2 * kSide + 2 * x;
      const float around =
          0.25F * (fine[corner] + fine[corner + 1] + fine[corner + 2 * kSide] + fine[corner + 2 * kSide + 1]);
      REQUIRE(coarse[y * kSide + x] == Approx(around).epsilon(0.05));
    }
  }
}

TEST_CASE("A seed gives its field again, another seed another") {
  CHECK(on_grid(field(5), 64) == on_grid(field(5), 64));
  CHECK(on_grid(field(5), 64) != on_grid(field(6), 64));
}

}  // namespace
}  // namespace scatter::corrosion
