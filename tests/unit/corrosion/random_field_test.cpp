// Expected values: the spectrum's integrals (Matern's covariance by its Hankel transform), not our own
// output.
#include "simulator/corrosion/random_field.h"

#include <catch2/catch.hpp>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <vector>

namespace scatter::corrosion {
namespace {

constexpr double kExtent = 50;
constexpr std::uint64_t kSeeds = 40;

FieldSpectrum spectrum(double length, double roughness, double finest) {
  return {.length_mm = length, .roughness = roughness, .finest_mm = finest};
}

/// Power at frequency f [1/mm], normalised as random_field.h says.
double power(const FieldSpectrum& s, double f) {
  const double q = std::pow(s.length_mm / s.finest_mm, 2);
  const double c =
      4 * std::numbers::pi * s.length_mm * s.length_mm * s.roughness / (1 - std::pow(1 + q, -s.roughness));
  return c * std::pow(1 + std::pow(2 * std::numbers::pi * f * s.length_mm, 2), -(1 + s.roughness));
}

/// Integral of power * J0(2 pi f r) over the plane up to the cut.
double covariance(const FieldSpectrum& s, double r) {
  const double cut = 1 / (2 * std::numbers::pi * s.finest_mm);
  constexpr int kSteps = 20000;
  double sum = 0;
  for (int i = 0; i < kSteps; ++i) {
    const double f = cut * (i + 0.5) / kSteps;
    sum += power(s, f) * std::cyl_bessel_j(0, 2 * std::numbers::pi * f * r) * 2 * std::numbers::pi * f;
  }
  return sum * cut / kSteps;
}

struct Lag {
  std::size_t x = 0;
  std::size_t y = 0;
};

double mean_product(const std::vector<float>& field, std::size_t side, Lag lag) {
  double sum = 0;
  for (std::size_t y = 0; y < side; ++y) {
    for (std::size_t x = 0; x < side; ++x) {
      sum += static_cast<double>(field[y * side + x]) *
             static_cast<double>(field[((y + lag.y) % side) * side + (x + lag.x) % side]);
    }
  }
  return sum / static_cast<double>(side * side);
}

TEST_CASE("A field's variance is that of its spectrum less what is longer than the sheet") {
  const FieldSpectrum long_one = spectrum(4, 0.5, 0.4);
  const FieldSpectrum short_one = spectrum(1, 0.8, 0.4);
  double sums[2] = {0, 0};
  FieldPair fields;
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    fields = random_fields(seed, 128, kExtent, {long_one, short_one});
    for (std::size_t k = 0; k < 2; ++k) {
      sums[k] += mean_product(fields.values[k], 128, {}) / kSeeds;
    }
  }
  // Some 1 / S(0) independent patches on each sheet: a standard error below 2 % after 40 sheets.
  CHECK(fields.variance[0] == Approx(1 - power(long_one, 0) / (kExtent * kExtent)).epsilon(0.005));
  CHECK(fields.variance[1] == Approx(1 - power(short_one, 0) / (kExtent * kExtent)).epsilon(0.005));
  CHECK(sums[0] == Approx(fields.variance[0]).epsilon(0.06));
  CHECK(sums[1] == Approx(fields.variance[1]).epsilon(0.03));
}

TEST_CASE("A field's covariance is the Hankel transform of its spectrum, alike in all directions") {
  constexpr std::size_t kSide = 125;  // cells of 0.4 mm
  const FieldSpectrum s = spectrum(2, 0.5, 0.2);
  // What the formula itself must say without a cut.
  CHECK(covariance(spectrum(2, 0.5, 0.002), 2) == Approx(std::exp(-1)).epsilon(0.005));
  const double missing = power(s, 0) / (kExtent * kExtent);
  for (const Lag lag : {Lag{5, 0}, Lag{0, 5}, Lag{3, 4}, Lag{4, 122}, Lag{10, 0}, Lag{0, 10}, Lag{6, 8}}) {
    double sum = 0;
    for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
      sum += mean_product(random_fields(seed, kSide, kExtent, {s, s}).values[0], kSide, lag) / kSeeds;
    }
    const double y = lag.y > kSide / 2 ? static_cast<double>(kSide - lag.y) : static_cast<double>(lag.y);
    const double r = 0.4 * std::hypot(static_cast<double>(lag.x), y);
    INFO("lag " << lag.x << ", " << lag.y);
    CHECK(sum == Approx(covariance(s, r) - missing).margin(0.02));
  }
}

TEST_CASE("A field is the same continuous field on every grid") {
  // 50 / (2 pi 0.2) = 39.8 waves: all of them fit on the coarser grid, too.
  const FieldSpectrum s = spectrum(4, 0.5, 0.2);
  const FieldPair coarse = random_fields(7, 100, kExtent, {s, s});
  const FieldPair fine = random_fields(7, 300, kExtent, {s, s});
  double worst = 0;
  for (std::size_t y = 0; y < 100; ++y) {
    for (std::size_t x = 0; x < 100; ++x) {
      // Middles of the coarse cells are middles of every third fine one.
      const std::size_t same = (3 * y + 1) * 300 + 3 * x + 1;
      for (std::size_t k = 0; k < 2; ++k) {
        worst = std::max(worst,
                         std::abs(static_cast<double>(coarse.values[k][y * 100 + x] - fine.values[k][same])));
      }
    }
  }
  CHECK(worst < 1e-5);
}

TEST_CASE("A field sampled too coarsely for its finest waves keeps the longer ones") {
  const FieldSpectrum s = spectrum(4, 0.8, 0.05);
  const FieldPair coarse = random_fields(7, 60, kExtent, {s, s});  // 30 of 159 waves
  const FieldPair fine = random_fields(7, 540, kExtent, {s, s});
  CHECK(coarse.variance[0] < fine.variance[0]);
  double sum = 0;
  for (std::size_t y = 0; y < 60; ++y) {
    for (std::size_t x = 0; x < 60; ++x) {
      const double gap = static_cast<double>(coarse.values[0][y * 60 + x]) -
                         static_cast<double>(fine.values[0][(9 * y + 4) * 540 + 9 * x + 4]);
      sum += gap * gap / 3600;
    }
  }
  // What differs is what the coarse grid left out.
  CHECK(sum == Approx(fine.variance[0] - coarse.variance[0]).epsilon(0.1));
}

TEST_CASE("The two fields of a pair are independent, and so are those of two seeds") {
  const FieldSpectrum s = spectrum(1, 0.5, 0.2);
  double within = 0;
  double between = 0;
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    const FieldPair one = random_fields(seed, 100, kExtent, {s, s});
    const FieldPair other = random_fields(seed + 1000, 100, kExtent, {s, s});
    for (std::size_t i = 0; i < one.values[0].size(); ++i) {
      within += static_cast<double>(one.values[0][i]) * static_cast<double>(one.values[1][i]);
      between += static_cast<double>(one.values[0][i]) * static_cast<double>(other.values[0][i]);
    }
  }
  // Standard error about sqrt(2 pi length^2 / (extent^2 seeds)) = 0.008.
  CHECK(std::abs(within / (1e4 * kSeeds)) < 0.03);
  CHECK(std::abs(between / (1e4 * kSeeds)) < 0.03);
}

TEST_CASE("A field joins at opposite borders as it does inside") {
  const FieldSpectrum s = spectrum(2, 0.5, 0.2);
  double seam = 0;
  double inside = 0;
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    const FieldPair fields = random_fields(seed, 96, kExtent, {s, s});
    const auto step = [&](std::size_t y, std::size_t from, std::size_t to) {
      const double gap = static_cast<double>(fields.values[0][y * 96 + from] - fields.values[0][y * 96 + to]);
      return gap * gap;
    };
    for (std::size_t y = 0; y < 96; ++y) {
      seam += step(y, 95, 0);
      inside += step(y, 47, 48);
    }
  }
  CHECK(seam / inside == Approx(1).epsilon(0.15));
}

TEST_CASE("A sheet smaller than the finest wave is even") {
  const FieldSpectrum s = spectrum(4, 0.5, 0.2);
  const FieldPair fields = random_fields(1, 16, 1, {s, s});
  CHECK(fields.variance[0] == 0);
  CHECK(fields.values[0] == std::vector<float>(256, 0.0F));
}

}  // namespace
}  // namespace scatter::corrosion
