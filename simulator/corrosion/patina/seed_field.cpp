#include "simulator/corrosion/patina/seed_field.h"

#include <algorithm>
#include <cmath>

#include "simulator/corrosion/patina/draws.h"
#include "simulator/random/stream.h"

namespace scatter::corrosion {
namespace {

struct Seed {
  double x;  ///< In lattice squares.
  double y;
  double log_value;
};

/// One seed somewhere in each square of an n x n lattice.
std::vector<Seed> draw_seeds(const SeedField& field, std::uint32_t scale, std::size_t n, double sigma) {
  std::vector<Seed> seeds(n * n);
  for (std::size_t i = 0; i < seeds.size(); ++i) {
    simulator::RandomStream stream(patina_key(field.seed, PatinaDraw::kSeedField, scale, i));
    const double u = stream.uniform();
    const double v = stream.uniform();
    seeds[i] = {static_cast<double>(i % n) + u, static_cast<double>(i / n) + v, sigma * stream.normal()};
  }
  return seeds;
}

/// Logarithm of the scale's field where the lattice place is (x, y).
double interpolate(const std::vector<Seed>& seeds, std::size_t n, double x, double y) {
  constexpr double kReach = 2;
  const auto size = static_cast<double>(n);
  const auto column = static_cast<long>(std::floor(x));
  const auto row = static_cast<long>(std::floor(y));
  const auto lattice = static_cast<long>(n);
  const auto wrapped = [lattice](long place) {
    while (place < 0) {
      place += lattice;
    }
    while (place >= lattice) {
      place -= lattice;
    }
    return place;
  };
  double sum = 0;
  double weights = 0;
  for (long j = row - 2; j <= row + 2; ++j) {
    const long wrapped_j = wrapped(j);
    for (long i = column - 2; i <= column + 2; ++i) {
      const long wrapped_i = wrapped(i);
      const Seed& seed = seeds[static_cast<std::size_t>(wrapped_j * lattice + wrapped_i)];
      // The copy of the seed in this square, which may lie beyond the border.
      const double dx = seed.x + static_cast<double>(i - wrapped_i) - x;
      const double dy = seed.y + static_cast<double>(j - wrapped_j) - y;
      const double d2 = dx * dx + dy * dy;
      if (d2 >= kReach * kReach) {
        continue;
      }
      if (d2 < 1e-18 * size) {
        return seed.log_value;
      }
      const double d = std::sqrt(d2);
      const double weight = (kReach - d) * (kReach - d) / d2;
      sum += weight * seed.log_value;
      weights += weight;
    }
  }
  return sum / weights;
}

}  // namespace

std::vector<float> on_grid(const SeedField& field, std::size_t side) {
  std::vector<double> logs(side * side, 0.0);
  if (field.sigma > 0) {
    double spacing = std::min(field.spacing_mm, field.extent_mm);
    double sigma = field.sigma;
    for (std::uint32_t scale = 0; scale < field.scales; ++scale, spacing /= 2, sigma /= 2) {
      const auto n = static_cast<std::size_t>(std::max(1.0, std::round(field.extent_mm / spacing)));
      if (2 * n > side) {
        break;
      }
      const std::vector<Seed> seeds = draw_seeds(field, scale, n, sigma);
      const double squares_per_cell = static_cast<double>(n) / static_cast<double>(side);
      for (std::size_t y = 0; y < side; ++y) {
        const double row = (static_cast<double>(y) + 0.5) * squares_per_cell;
        for (std::size_t x = 0; x < side; ++x) {
          logs[y * side + x] += interpolate(seeds, n, (static_cast<double>(x) + 0.5) * squares_per_cell, row);
        }
      }
    }
  }
  std::vector<float> values(logs.size());
  double sum = 0;
  for (const double value : logs) {
    sum += std::exp(value);
  }
  const double to_mean = static_cast<double>(logs.size()) / sum;
  std::ranges::transform(logs, values.begin(),
                         [&](double v) { return static_cast<float>(std::exp(v) * to_mean); });
  return values;
}

}  // namespace scatter::corrosion
