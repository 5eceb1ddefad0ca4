// Mode::kThesis against the plain scan, the grid and its own seam.
#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <functional>
#include <vector>

#include "simulator/corrosion/growth.h"
#include "tests/reference/full_scan_corrosion.h"
#include "tests/unit/corrosion/sheet_rules.h"
#include "tests/unit/corrosion/thesis_options.h"

namespace scatter::corrosion {
namespace {

Sheet sheet_of(const GrowthOptions& options) {
  const auto growth = Growth::run(options);
  REQUIRE(growth);
  return *(*growth)->at(options.age_years);
}

constexpr int kSeeds = 100;
using Quantities =
    std::array<double, 5>;  ///< Corroded, state 3, holes, standard deviation of heights, events.

template <typename Heights>
double deviation(const Heights& heights) {
  double sum = 0;
  double sum2 = 0;
  for (const auto height : heights) {
    sum += static_cast<double>(height);
    sum2 += static_cast<double>(height) * static_cast<double>(height);
  }
  const auto n = static_cast<double>(heights.size());
  return std::sqrt(sum2 / n - sum / n * (sum / n));
}

Quantities of_product(const GrowthOptions& options) {
  const Sheet sheet = sheet_of(options);
  return {sheet.corroded_fraction, sheet.state3_fraction, sheet.hole_fraction, deviation(sheet.height),
          static_cast<double>(sheet.events)};
}

Quantities of_reference(const GrowthOptions& options) {
  reference::FullScanCorrosion run(options);
  run.run();
  Quantities result{};
  const std::vector<std::uint8_t> opening = openings_of(options);
  double metal = 0;
  for (std::size_t i = 0; i < run.states().size(); ++i) {
    if (opening.empty() || opening[i] == 0) {
      const std::uint8_t state = run.states()[i];
      ++metal;
      result[0] += state >= 2 ? 1 : 0;
      result[1] += state == 3 ? 1 : 0;
      result[2] += state == 4 ? 1 : 0;
    }
  }
  for (std::size_t i = 0; i < 3; ++i) {
    result[i] /= metal;
  }
  result[3] = deviation(run.heights());
  result[4] = static_cast<double>(run.events());
  return result;
}

void compare(GrowthOptions options) {
  Quantities sum[2] = {};
  Quantities sum2[2] = {};
  for (int seed = 1; seed <= kSeeds; ++seed) {
    options.seed = static_cast<std::uint64_t>(seed);
    const Quantities found[2] = {of_product(options), of_reference(options)};
    for (std::size_t k = 0; k < 2; ++k) {
      for (std::size_t q = 0; q < found[k].size(); ++q) {
        sum[k][q] += found[k][q];
        sum2[k][q] += found[k][q] * found[k][q];
      }
    }
  }
  for (std::size_t q = 0; q < sum[0].size(); ++q) {
    double variance = 0;
    for (std::size_t k = 0; k < 2; ++k) {
      const double mean = sum[k][q] / kSeeds;
      variance += (sum2[k][q] / kSeeds - mean * mean) / (kSeeds - 1);
    }
    const double difference = (sum[0][q] - sum[1][q]) / kSeeds;
    INFO("quantity " << q << ": " << sum[0][q] / kSeeds << " against " << sum[1][q] / kSeeds << ", z "
                     << difference / std::sqrt(variance));
    CHECK(std::abs(difference) <= 3 * std::sqrt(variance) + 1e-12);
  }
}

// PROVES: corrosion.md 5.1, check 11: 100 seeds each, all |z| < 3.
TEST_CASE("Thesis mode: means over 100 seeds are those of the full scan, on an even sheet") {
  compare(thesis(64, Corrosivity::kLow, 10));
}

TEST_CASE("Thesis mode: means over 100 seeds are those of the full scan, with uneven maps") {
  GrowthOptions options = thesis(48, Corrosivity::kMedium, 10);
  options.surface = {
      4, 4, {0.1F, 0.9F, 0.5F, 0.99F, 1, 0.3F, 0, 0.6F, 0.2F, 0.7F, 0.4F, 0.8F, 0.5F, 0.1F, 0.95F, 0.3F}};
  options.material = {3, 2, {0.3F, 0.8F, 0.5F, 0.9F, 0.1F, 0.6F}};
  options.exposure = {2, 2, {1, 2, 0.5F, 1}};
  compare(options);
}

TEST_CASE(
    "Thesis mode: means over 100 seeds are those of the full scan, clamped, pierced and with conversion "
    "removal") {
  GrowthOptions options = thesis(48, Corrosivity::kVeryHigh, 2);
  options.thickness_mm = 2;
  options.border = Border::kClamped;
  options.events.conversion_removes = true;
  options.opening = {6, 6, std::vector<float>(36, 1.0F)};
  options.opening.values[14] = 0;
  options.late_points = 3;
  compare(options);
}

TEST_CASE("Thesis mode: the corroded share settles with the grid from 256 cells on") {
  // PROVES: corrosion.md 5.1, check 10; 4.5 found .360 .357 .356 .355 from 256 to 2048 at 10 years.
  double last = 0;
  for (const std::size_t side : {256U, 512U, 1024U}) {
    double corroded = 0;
    for (std::uint64_t seed = 1; seed <= 3; ++seed) {
      GrowthOptions options = thesis(side, Corrosivity::kLow, 10);
      options.seed = seed;
      corroded += sheet_of(options).corroded_fraction / 3;
    }
    if (last > 0) {
      CHECK(corroded - last <= 0.01);
      CHECK(std::abs(corroded - last) <= 0.01);
    }
    last = corroded;
  }
}

/// Largest distance of the two samples' distribution functions.
double kolmogorov_smirnov(std::vector<double> a, std::vector<double> b) {
  std::sort(a.begin(), a.end());
  std::sort(b.begin(), b.end());
  double largest = 0;
  for (const double x : a) {
    const auto share = [x](const std::vector<double>& v) {
      return static_cast<double>(std::upper_bound(v.begin(), v.end(), x) - v.begin()) /
             static_cast<double>(v.size());
    };
    largest = std::max(largest, std::abs(share(a) - share(b)));
  }
  return largest;
}

TEST_CASE("Thesis mode: no seam: steps across the border are distributed as those inside") {
  // PROVES: corrosion.md 5.1, check 8: Kolmogorov and Smirnov, p > 0.01.
  std::vector<double> seam;
  std::vector<double> inside;
  constexpr std::size_t kSide = 128;
  for (std::uint64_t seed = 1; seed <= 24; ++seed) {
    GrowthOptions options = thesis(kSide, Corrosivity::kHigh, 5);
    options.seed = seed;
    const Sheet sheet = sheet_of(options);
    const auto step = [&](std::size_t a, std::size_t b) {
      return std::abs(static_cast<double>(sheet.height[a]) - static_cast<double>(sheet.height[b]));
    };
    // Every eighth place, so that neighbours' likeness does not feign more data than there is.
    for (std::size_t i = 0; i < kSide; i += 8) {
      seam.push_back(step(i * kSide, i * kSide + kSide - 1));
      seam.push_back(step(i, (kSide - 1) * kSide + i));
      for (std::size_t k = 20; k < 120; k += 20) {
        inside.push_back(step(i * kSide + k, i * kSide + k + 1));
        inside.push_back(step(k * kSide + i, (k + 1) * kSide + i));
      }
    }
  }
  const auto n = static_cast<double>(seam.size());
  const auto m = static_cast<double>(inside.size());
  CHECK(kolmogorov_smirnov(seam, inside) < 1.628 * std::sqrt((n + m) / (n * m)));
}

TEST_CASE("Thesis mode: a shifted surface map shifts the statistics") {
  // PROVES: corrosion.md 5.1, check 8. Vulnerable on one half, well protected on the other.
  const auto halves = [](bool shifted) {
    std::array<double, 2> corroded{};
    for (std::uint64_t seed = 1; seed <= 6; ++seed) {
      GrowthOptions options = thesis(128, Corrosivity::kLow, 3);
      options.surface = {8, 1, std::vector<float>(8, 0.1F)};
      for (std::size_t x = 0; x < 4; ++x) {
        options.surface.values[shifted ? x : x + 4] = 0.95F;
      }
      options.seed = seed + (shifted ? 100 : 0);
      const Sheet sheet = sheet_of(options);
      for (std::size_t i = 0; i < sheet.cells(); ++i) {
        corroded[i % 128 / 64] += sheet.state[i] >= CellState::kSpreading ? 1.0 / (6 * 8192) : 0;
      }
    }
    return corroded;
  };
  const auto plain = halves(false);
  const auto shifted = halves(true);
  CHECK(plain[0] > 4 * plain[1]);
  CHECK(shifted[1] == Approx(plain[0]).epsilon(0.1));
  CHECK(shifted[0] == Approx(plain[1]).margin(0.02));
}

TEST_CASE("Thesis mode: after every single event each cell's state is as its neighbours' states ask") {
  // PROVES: corrosion.md 5.1, check 12, on 32 x 32 cells.
  for (const Border border : {Border::kToroidal, Border::kClamped}) {
    for (const bool converts : {false, true}) {
      GrowthOptions options = thesis(32, Corrosivity::kVeryHigh, 13);
      options.border = border;
      options.starting_points = 6;
      options.events.conversion_removes = converts;
      options.events.bite = 0.2;
      options.seed = converts ? 3 : 4;
      options.late_points = border == Border::kClamped ? 0 : 30;
      const auto growth = *Growth::run(options);
      // Ages half a hit apart: no event goes unseen.
      const double hit = 0.2 / 1024 * 7800;
      std::vector<double> ages;
      for (double loss = 0; loss < mass_loss_g_per_m2(Corrosivity::kVeryHigh, Law::kThesis, 13);
           loss += hit / 2) {
        ages.push_back(age_of_loss_years(Corrosivity::kVeryHigh, Law::kThesis, loss));
      }
      std::uint64_t events = 0;
      std::size_t most_waiting = 0;
      std::string broken;
      REQUIRE(growth->each(ages, [&](const Sheet& sheet) {
        std::size_t waiting = 0;
        if (broken.empty()) {
          broken = broken_rule(sheet, &waiting);
        }
        most_waiting = std::max(most_waiting, waiting);
        if (!converts && sheet.events > events + 1) {
          broken = "an event was not seen";
        }
        events = sheet.events;
      }));
      CHECK(broken == "");
      CHECK(events > 3000);
      CHECK((most_waiting > 0) == (border == Border::kToroidal));
    }
  }
}

}  // namespace
}  // namespace scatter::corrosion
