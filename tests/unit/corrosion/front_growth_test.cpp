// Mode::kPhysical: checks 1, 3 to 8 and 12 of corrosion.md 5.1, and closed forms where there is no
// randomness.
#include <fmt/core.h>
#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <numbers>
#include <numeric>
#include <stop_token>
#include <string>
#include <vector>

#include "simulator/corrosion/cells.h"
#include "simulator/corrosion/exposure.h"
#include "simulator/corrosion/front_replay.h"
#include "simulator/corrosion/growth.h"
#include "tests/unit/corrosion/sheet_rules.h"

namespace scatter::corrosion {
namespace {

std::shared_ptr<const Growth> grown(const GrowthOptions& options) {
  auto growth = Growth::run(options);
  REQUIRE(growth);
  return *growth;
}

Sheet sheet_of(const GrowthOptions& options) {
  return grown(options)->at(options.age_years).value();
}

GrowthOptions small(Corrosivity corrosivity, double age) {
  GrowthOptions options;
  options.side = 256;
  options.corrosivity = corrosivity;
  options.age_years = age;
  return options;
}

/// From the heights alone [g/m^2].
double weighed(const Sheet& sheet) {
  double lost = 0;
  for (const float height : sheet.height) {
    lost += 1 - static_cast<double>(height);
  }
  return lost / static_cast<double>(sheet.cells()) * sheet.thickness_mm * 1000 * 7.8;
}

std::uint32_t start_of(const Sheet& sheet) {
  return static_cast<std::uint32_t>(std::ranges::min_element(*sheet.birth_years) -
                                    sheet.birth_years->begin());
}

/// A map of n x n cells by a function of the place, 0..1 each way.
template <typename Function>
Map map_of(std::size_t n, Function function) {
  Map map{n, n, std::vector<float>(n * n)};
  for (std::size_t i = 0; i < map.values.size(); ++i) {
    map.values[i] = static_cast<float>(function((static_cast<double>(i % n) + 0.5) / static_cast<double>(n),
                                                (static_cast<double>(i / n) + 0.5) / static_cast<double>(n)));
  }
  return map;
}

TEST_CASE("Physical: without randomness one point grows a cone whose radius and depth follow from the mass") {
  GrowthOptions options = small(Corrosivity::kLow, 1);
  options.side = 512;
  options.starting_points = 1;
  options.late_points = 0;
  options.front.front_sigma = 0;
  options.front.pit_sigma = 0;
  options.front.skin_um = 0;
  options.front.depth_per_spread = 0.02;
  const Sheet sheet = sheet_of(options);
  // Mean depth of a cone of slope 0.02 and radius r on 50 mm x 50 mm: 0.02 pi r^3 / 3 / 2500 mm; age 1 takes
  // 100.4 g/m^2.
  const double depth_mm = 100.4 / 7.8 / 1000;
  const double radius = std::cbrt(depth_mm * 2500 * 3 / (0.02 * std::numbers::pi));
  REQUIRE(radius < 25);
  CHECK(sheet.corroded_fraction == Approx(std::numbers::pi * radius * radius / 2500).epsilon(0.02));
  const std::uint32_t start = start_of(sheet);
  double worst = 0;
  for (std::size_t i = 0; i < sheet.cells(); ++i) {
    const auto step = [&](std::size_t a, std::size_t b) {
      const double way = std::abs(static_cast<double>(a) - static_cast<double>(b));
      return std::min(way, 512 - way) * sheet.cell_mm();
    };
    const double r = std::hypot(step(i % 512, start % 512), step(i / 512, start / 512));
    const double expected = 1 - 0.02 * std::max(radius - r, 0.0);
    worst = std::max(worst, std::abs(static_cast<double>(sheet.height[i]) - expected));
  }
  // 1.2 cells of 0.098 mm: what a front gains at its start, and the radius with it.
  CHECK(worst < 0.02 * 1.2 * sheet.cell_mm());
}

TEST_CASE("Physical: the loss is the law's to 1e-6 in every class, and what is reported is what is gone") {
  for (const Corrosivity corrosivity : kCorrosivities) {
    const GrowthOptions options = small(corrosivity, 20);
    const auto growth = grown(options);
    for (const double age : {0.5, 1.0, 5.0, 12.5, 20.0}) {
      const Sheet sheet = growth->at(age).value();
      const double target =
          std::min(mass_loss_g_per_m2(corrosivity, Law::kThesis, age), options.thickness_mm * 7800);
      INFO(name(corrosivity) << ", " << age << " years");
      CHECK(weighed(sheet) == Approx(target).epsilon(1e-6));
      CHECK(sheet.mass_loss_g_per_m2 == Approx(weighed(sheet)).epsilon(1e-9));
      CHECK(sheet.target_g_per_m2 == mass_loss_g_per_m2(corrosivity, Law::kThesis, age));
      CHECK(sheet.exhausted == (sheet.target_g_per_m2 > 7800));
    }
  }
}

TEST_CASE("Physical: before the first age all is intact, later ages are nested and only go deeper") {
  const auto growth = grown(small(Corrosivity::kVeryHigh, 100));
  std::vector<double> ages(101);
  std::iota(ages.begin(), ages.end(), 0.0);
  Sheet before;
  REQUIRE(growth->each(ages, [&](const Sheet& sheet) {
    if (sheet.age_years == 0) {
      CHECK(std::ranges::all_of(sheet.height, [](float h) { return h == 1; }));
      CHECK(std::ranges::all_of(sheet.state, [](CellState s) { return s == CellState::kUntouched; }));
      CHECK(sheet.mass_loss_g_per_m2 == 0);
    } else {
      bool nested = true;
      for (std::size_t i = 0; i < sheet.cells(); ++i) {
        nested = nested && sheet.height[i] <= before.height[i] && sheet.state[i] >= before.state[i];
      }
      CHECK(nested);
    }
    before = sheet;
  }));
  CHECK(before.hole_fraction == 1);
  CHECK(before.exhausted);
}

TEST_CASE("Physical: a sheet shown in a series is the sheet shown alone") {
  const auto growth = grown(small(Corrosivity::kMedium, 30));
  const std::vector<double> ages{1, 7, 7, 30};
  REQUIRE(growth->each(ages, [&](const Sheet& sheet) {
    const Sheet alone = growth->at(sheet.age_years).value();
    CHECK(hash(sheet) == hash(alone));
    CHECK(sheet.state3_fraction == alone.state3_fraction);
  }));
}

TEST_CASE("Physical: a cell is corroded at an age when its birth is not later") {
  const auto growth = grown(small(Corrosivity::kMedium, 30));
  const Sheet sheet = growth->at(10).value();
  std::size_t wrong = 0;
  std::size_t never = 0;
  for (std::size_t i = 0; i < sheet.cells(); ++i) {
    const double birth = static_cast<double>((*sheet.birth_years)[i]);
    const bool corroded = sheet.state[i] >= CellState::kSpreading;
    wrong += std::abs(birth - 10) > 1e-3 && corroded != (birth <= 10) ? 1 : 0;
    never += std::isinf(birth) ? 1 : 0;
    REQUIRE((std::isinf(birth) || (birth >= 0 && birth <= 30)));
  }
  CHECK(wrong == 0);
  const Sheet last = growth->at(30).value();
  CHECK(static_cast<double>(never) ==
        Approx((1 - last.corroded_fraction) * static_cast<double>(last.cells())));
}

TEST_CASE("Physical: at equal mass more points corrode more of the sheet") {
  double before = 0;
  for (const std::uint32_t points : {10U, 30U, 50U, 100U, 150U}) {
    double corroded = 0;
    for (std::uint64_t seed = 1; seed <= 6; ++seed) {
      GrowthOptions options = small(Corrosivity::kLow, 1);
      options.starting_points = points;
      options.late_points = 0;
      options.seed = seed;
      corroded += sheet_of(options).corroded_fraction / 6;
    }
    CHECK(corroded > before);
    before = corroded;
  }
}

TEST_CASE("Physical: no hole opens before the metal can be used up") {
  GrowthOptions options = small(Corrosivity::kHigh, 5);
  options.thickness_mm = 50;
  CHECK(sheet_of(options).hole_fraction == 0);
  options.thickness_mm = 0.3;
  CHECK(sheet_of(options).hole_fraction > 0.1);
}

TEST_CASE("Physical: equal seeds give equal bytes in any company, other seeds do not") {
  std::vector<GrowthOptions> batch;
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    batch.push_back(small(Corrosivity::kMedium, 10));
    batch.back().seed = seed;
  }
  const auto together = Growth::run_all(batch);
  std::vector<std::string> hashes;
  for (std::size_t i = 0; i < batch.size(); ++i) {
    REQUIRE(together[i]);
    hashes.push_back(hash((*together[i])->at(10).value()));
    CHECK(hashes.back() == hash(sheet_of(batch[i])));
  }
  std::ranges::sort(hashes);
  CHECK(std::ranges::adjacent_find(hashes) == hashes.end());
}

TEST_CASE("Physical: states obey the thesis's rules at every age, late seeds wait untouched") {
  std::size_t waited = 0;
  for (const Border border : {Border::kToroidal, Border::kClamped}) {
    GrowthOptions options = small(Corrosivity::kHigh, 60);
    options.side = 64;
    options.border = border;
    options.starting_points = 3;
    options.late_points = 100;
    options.surface = map_of(16, [](double x, double y) { return x < 0.3 && y < 0.6 ? 1.0 : 0.3; });
    options.least_susceptibility = 0;
    options.opening =
        map_of(16, [](double x, double y) { return std::hypot(x - 0.6, y - 0.4) < 0.15 ? 0.0 : 1.0; });
    const auto growth = grown(options);
    std::vector<double> ages;
    for (int i = 0; i <= 240; ++i) {
      ages.push_back(0.25 * i);
    }
    REQUIRE(growth->each(ages, [&](const Sheet& sheet) {
      std::size_t waiting = 0;
      REQUIRE(broken_rule(sheet, &waiting) == "");
      waited += waiting;
    }));
  }
  CHECK(waited > 0);
}

TEST_CASE("Physical: what the quick pass finds is what the plain rules find") {
  for (const Border border : {Border::kToroidal, Border::kClamped}) {
    for (const bool open : {false, true}) {
      GrowthOptions options = small(Corrosivity::kVeryHigh, 8);
      options.side = 101;
      options.border = border;
      options.late_points = 0;
      if (open) {
        options.opening = map_of(8, [](double x, double) { return x < 0.3 ? 0.0 : 1.0; });
      }
      const Sheet sheet = sheet_of(options);
      std::vector<std::uint8_t> corroded(sheet.cells());
      for (std::size_t i = 0; i < corroded.size(); ++i) {
        corroded[i] = std::isinf((*sheet.birth_years)[i]) ? 0 : 1;
      }
      Sheet plain = sheet;
      find_states(corroded, openings_of(options), sheet.height, {}, sheet.side, border, plain.state);
      account(openings_of(options), plain);
      CHECK(plain.state == sheet.state);
      CHECK(plain.corroded_fraction == sheet.corroded_fraction);
      CHECK(plain.state3_fraction == sheet.state3_fraction);
      CHECK(plain.hole_fraction == sheet.hole_fraction);
      CHECK(plain.mass_loss_g_per_m2 == Approx(sheet.mass_loss_g_per_m2).epsilon(1e-9));
    }
  }
}

TEST_CASE("Physical: white surface is a mask when nothing is susceptible there") {
  GrowthOptions options = small(Corrosivity::kVeryHigh, 100);
  options.surface = map_of(256, [](double x, double) { return x > 0.5 ? 1.0 : 0.2; });
  options.least_susceptibility = 0;
  const Sheet sheet = sheet_of(options);
  for (std::size_t i = 0; i < sheet.cells(); ++i) {
    if (i % 256 >= 128) {
      REQUIRE(sheet.state[i] <= CellState::kThreatened);
      REQUIRE(sheet.height[i] == 1);
    }
  }
  CHECK(sheet.corroded_fraction == 0.5);
  CHECK(sheet.exhausted);
  CHECK(sheet.mass_loss_g_per_m2 == Approx(3900).epsilon(1e-6));
}

TEST_CASE("Physical: openings are holes that neither corrode nor count") {
  GrowthOptions options = small(Corrosivity::kMedium, 20);
  options.opening =
      map_of(256, [](double x, double y) { return std::hypot(x - 0.5, y - 0.5) < 0.3 ? 0.0 : 1.0; });
  const Sheet sheet = sheet_of(options);
  std::size_t open = 0;
  double lost = 0;
  for (std::size_t i = 0; i < sheet.cells(); ++i) {
    const bool is_open = std::hypot((static_cast<double>(i % 256) + 0.5) / 256 - 0.5,
                                    (static_cast<double>(i / 256) + 0.5) / 256 - 0.5) < 0.3;
    open += is_open ? 1 : 0;
    lost += is_open ? 0 : 1 - static_cast<double>(sheet.height[i]);
    if (is_open) {
      REQUIRE(sheet.state[i] == CellState::kHole);
      REQUIRE(std::isinf((*sheet.birth_years)[i]));
    }
  }
  CHECK(lost / static_cast<double>(sheet.cells() - open) * 7800 ==
        Approx(sheet.target_g_per_m2).epsilon(1e-6));
  CHECK(sheet.hole_fraction < 0.1);
}

TEST_CASE("Physical: metal corrodes most beside a nobler one and beside a cover, hardly below it") {
  const auto loss_between = [](const Sheet& sheet, double from, double to) {
    double lost = 0;
    double cells = 0;
    for (std::size_t i = 0; i < sheet.cells(); ++i) {
      const double x = (static_cast<double>(i % sheet.side) + 0.5) / static_cast<double>(sheet.side);
      if (x >= from && x < to) {
        lost += 1 - static_cast<double>(sheet.height[i]);
        ++cells;
      }
    }
    return lost / cells;
  };
  const Map strip = map_of(256, [](double x, double) { return x > 0.4 && x < 0.6 ? 1.0 : 0.0; });
  GrowthOptions options = small(Corrosivity::kMedium, 10);
  options.starting_points = 200;
  options.border = Border::kClamped;
  options.exposure = galvanic_exposure(strip, 50, options.border, {.contact_gain = 20}).value();
  const Sheet contact = sheet_of(options);
  CHECK(loss_between(contact, 0.405, 0.595) == 0);
  CHECK(loss_between(contact, 0.3, 0.395) > 2 * loss_between(contact, 0, 0.1));
  options.exposure = aeration_exposure(strip, 50, options.border).value();
  const Sheet cover = sheet_of(options);
  CHECK(loss_between(cover, 0.42, 0.58) < 0.05 * loss_between(cover, 0, 0.1));
  CHECK(loss_between(cover, 0.35, 0.395) > 1.5 * loss_between(cover, 0, 0.1));
}

TEST_CASE("Physical: the seam of a tile is like any line inside, and a shifted surface shifts the rust") {
  // Kolmogorov and Smirnov's distance between the steps of height across the seam and across lines inside.
  std::vector<float> seam;
  std::vector<float> inside;
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    GrowthOptions options = small(Corrosivity::kMedium, 25);
    options.seed = seed;
    const Sheet sheet = sheet_of(options);
    for (std::size_t y = 0; y < 256; y += 8) {  // as far apart as steps are independent
      const auto step = [&](std::size_t a, std::size_t b) {
        return std::abs(sheet.height[y * 256 + a] - sheet.height[y * 256 + b]);
      };
      seam.push_back(step(255, 0));
      for (const std::size_t x : {31U, 63U, 95U, 127U, 159U, 191U, 223U}) {
        inside.push_back(step(x, x + 1));
      }
    }
  }
  std::ranges::sort(seam);
  std::ranges::sort(inside);
  double distance = 0;
  for (const float value : seam) {
    const auto share = [value](const std::vector<float>& sorted) {
      return static_cast<double>(std::ranges::upper_bound(sorted, value) - sorted.begin()) /
             static_cast<double>(sorted.size());
    };
    distance = std::max(distance, std::abs(share(seam) - share(inside)));
  }
  const double n = static_cast<double>(seam.size());
  const double m = static_cast<double>(inside.size());
  CHECK(distance < 1.63 * std::sqrt((n + m) / (n * m)));  // p > 0.01

  const auto corroded = [](const Sheet& sheet, bool right) {
    double count = 0;
    for (std::size_t i = 0; i < sheet.cells(); ++i) {
      count += (i % 256 >= 128) == right && sheet.state[i] >= CellState::kSpreading ? 1 : 0;
    }
    return count / 32768;
  };
  double dark[2] = {0, 0};
  double light[2] = {0, 0};
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    for (const bool right : {false, true}) {
      GrowthOptions options = small(Corrosivity::kLow, 10);
      options.seed = seed;
      options.surface = map_of(2, [right](double x, double) { return (x > 0.5) == right ? 0.2 : 0.95; });
      const Sheet sheet = sheet_of(options);
      dark[right ? 1 : 0] += corroded(sheet, right) / 12;
      light[right ? 1 : 0] += corroded(sheet, !right) / 12;
    }
  }
  CHECK(dark[0] > 2 * light[0]);
  CHECK(dark[0] == Approx(dark[1]).epsilon(0.15));
  CHECK(light[0] == Approx(light[1]).margin(0.06));
}

TEST_CASE("Physical: late seeds break out later, in proportion to the mass lost") {
  GrowthOptions options = small(Corrosivity::kLow, 20);
  options.starting_points = 1;
  options.front.front_sigma = 0;
  options.late_points = 0;
  const auto patches = [](const GrowthOptions& with) {
    const Sheet sheet = sheet_of(with);
    // A cell that corroded before all around it is where a patch began.
    std::size_t count = 0;
    for (std::uint32_t i = 0; i < sheet.cells(); ++i) {
      const float own = (*sheet.birth_years)[i];
      bool first = !std::isinf(own);
      visit_neighbours(i, 256, with.border,
                       [&](std::uint32_t other) { first = first && (*sheet.birth_years)[other] > own; });
      count += first ? 1 : 0;
    }
    return count;
  };
  CHECK(patches(options) == 1);
  options.late_points = 100;
  // 376 g/m^2 bring 37.6 seeds on average; some fall on rust or still wait.
  const std::size_t many = patches(options);
  CHECK(many > 12);
  CHECK(many < 38 + 4 * 6);
}

TEST_CASE("Physical: a run can be stopped and tells how far it is") {
  std::stop_source stop;
  stop.request_stop();
  const auto stopped = Growth::run(small(Corrosivity::kMedium, 10), {}, stop.get_token());
  REQUIRE_FALSE(stopped);
  CHECK(stopped.error().code == ErrorCode::kAborted);
  std::vector<double> shown;
  REQUIRE(Growth::run(small(Corrosivity::kMedium, 10), [&](double share) { shown.push_back(share); }));
  CHECK(std::ranges::is_sorted(shown));
  CHECK(shown.size() > 50);
  CHECK(shown.back() == 1);
}

TEST_CASE("Physical: a reserve is never taken, and more points than cells that may corrode are refused") {
  GrowthOptions options = small(Corrosivity::kVeryHigh, 50);
  options.reserve = 0.4;
  const Sheet sheet = sheet_of(options);
  CHECK(weighed(sheet) == Approx(0.6 * 7800).epsilon(1e-6));
  CHECK(sheet.exhausted);
  options.exposure = Map{1, 1, {0.0F}};
  const auto refused = Growth::run(options);
  REQUIRE_FALSE(refused);
  CHECK(refused.error().what.find("starting_points") == 0);
}

}  // namespace
}  // namespace scatter::corrosion
