// Mode::kThesis: mass, ages, seeds, holes, reproducibility.
#include "simulator/corrosion/event_growth.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <numeric>
#include <thread>

#include "simulator/corrosion/growth.h"
#include "tests/unit/corrosion/sheet_rules.h"
#include "tests/unit/corrosion/thesis_options.h"

namespace scatter::corrosion {
namespace {

std::shared_ptr<const Growth> grown(const GrowthOptions& options) {
  auto result = Growth::run(options);
  REQUIRE(result);
  return *result;
}

Map waves() {
  Map map{32, 32, {}};
  for (int y = 0; y < 32; ++y) {
    for (int x = 0; x < 32; ++x) {
      map.values.push_back(static_cast<float>(0.5 + 0.45 * std::sin(x * 0.3927) * std::cos(y * 0.19635)));
    }
  }
  return map;
}

double loss_of_heights(const Sheet& sheet, std::size_t metal) {
  double left = std::accumulate(sheet.height.begin(), sheet.height.end(), 0.0);
  return (static_cast<double>(metal) - left) / static_cast<double>(metal) * sheet.thickness_mm * 7800;
}

TEST_CASE(
    "Thesis mode: the loss is the law's to 1e-6 and equals that of the heights, for every class and law") {
  // PROVES: corrosion.md 5.1, check 1.
  for (const Corrosivity corrosivity : kCorrosivities) {
    for (const Law law : {Law::kThesis, Law::kIso9224}) {
      for (const bool uneven : {false, true}) {
        GrowthOptions options = thesis(128, corrosivity, 20);
        options.law = law;
        options.thickness_mm = 3;
        if (uneven) {
          options.material = waves();
          options.surface = waves();
          options.events.conversion_removes = true;
        }
        const auto growth = grown(options);
        for (const double age : {0.5, 1.0, 7.3, 20.0}) {
          const Sheet sheet = *growth->at(age);
          REQUIRE(!sheet.exhausted);
          CHECK(sheet.target_g_per_m2 == mass_loss_g_per_m2(corrosivity, law, age));
          CHECK(sheet.mass_loss_g_per_m2 == Approx(sheet.target_g_per_m2).epsilon(1e-6));
          CHECK(loss_of_heights(sheet, sheet.cells()) == Approx(sheet.mass_loss_g_per_m2).epsilon(1e-12));
        }
      }
    }
  }
}

TEST_CASE("Thesis mode: fractions are those of the states, at every age of a series") {
  GrowthOptions options = thesis(64, Corrosivity::kVeryHigh, 20);
  options.opening = {8, 8, std::vector<float>(64, 1.0F)};
  options.opening.values[9] = 0;
  std::vector<double> ages(41);
  for (std::size_t i = 0; i < ages.size(); ++i) {
    ages[i] = 0.5 * static_cast<double>(i);
  }
  const std::vector<std::uint8_t> opening = openings_of(options);
  CHECK(std::count(opening.begin(), opening.end(), 1) > 0);
  REQUIRE(grown(options)->each(ages, [&](const Sheet& sheet) {
    Sheet counted = sheet;
    account(opening, counted);
    CHECK(counted.corroded_fraction == Approx(sheet.corroded_fraction).epsilon(1e-12));
    CHECK(counted.state3_fraction == Approx(sheet.state3_fraction).epsilon(1e-12));
    CHECK(counted.hole_fraction == Approx(sheet.hole_fraction).epsilon(1e-12));
    CHECK(counted.mass_loss_g_per_m2 == Approx(sheet.mass_loss_g_per_m2).epsilon(1e-12));
    for (std::size_t i = 0; i < opening.size(); ++i) {
      REQUIRE((opening[i] == 0 || (sheet.state[i] == CellState::kHole && sheet.height[i] == 0)));
    }
  }));
}

TEST_CASE("Thesis mode: at age 0 the sheet is as new") {
  // PROVES: corrosion.md 5.1, check 3.
  const auto growth = grown(thesis(64, Corrosivity::kHigh, 0));
  const Sheet sheet = *growth->at(0);
  CHECK(sheet.events == 0);
  CHECK(!sheet.exhausted);
  CHECK(std::all_of(sheet.height.begin(), sheet.height.end(), [](float h) { return h == 1; }));
  CHECK(std::all_of(sheet.state.begin(), sheet.state.end(),
                    [](CellState s) { return s == CellState::kUntouched; }));
}

TEST_CASE("Thesis mode: a sheet that is used up before the target says so and ends") {
  // PROVES: corrosion.md 5.1, check 3; very high takes all of 1 mm at 14.3 years.
  const auto growth = grown(thesis(64, Corrosivity::kVeryHigh, 100));
  CHECK(!growth->at(14)->exhausted);
  const Sheet gone = *growth->at(15);
  CHECK(gone.exhausted);
  CHECK(gone.hole_fraction == 1);
  CHECK(gone.mass_loss_g_per_m2 == 7800);
  CHECK(gone.target_g_per_m2 > 7800);

  GrowthOptions spared = thesis(64, Corrosivity::kVeryHigh, 100);
  spared.reserve = 0.4;
  const Sheet rest = *grown(spared)->at(100);
  CHECK(rest.exhausted);
  CHECK(rest.mass_loss_g_per_m2 == Approx(7800 * 0.6).epsilon(1e-6));
}

TEST_CASE("Thesis mode: where all that may corrode has, the run ends and says so") {
  // White with no least susceptibility is a mask; only the dark middle may corrode, and cells at its edge
  // never get deeper.
  GrowthOptions options = thesis(64, Corrosivity::kVeryHigh, 30);
  options.least_susceptibility = 0;
  options.surface = {64, 64, std::vector<float>(4096, 1.0F)};
  for (std::size_t y = 20; y < 40; ++y) {
    for (std::size_t x = 20; x < 40; ++x) {
      options.surface.values[y * 64 + x] = 0.2F;
    }
  }
  const Sheet sheet = *grown(options)->at(30);
  CHECK(sheet.exhausted);
  CHECK(sheet.corroded_fraction == Approx(400.0 / 4096));
  CHECK(sheet.hole_fraction == Approx(324.0 / 4096));
  // 76 cells at the edge have lost one bite each; a bite is a whole number of units.
  CHECK(sheet.mass_loss_g_per_m2 == Approx((324 + 76 * 0.05) / 4096 * 7800).epsilon(1e-6));

  // Metal so good that a hit takes nothing: rust covers everything and no mass is lost.
  GrowthOptions noble = thesis(32, Corrosivity::kLow, 10);
  noble.material.values = {1.0F};
  const Sheet covered = *grown(noble)->at(10);
  CHECK(covered.exhausted);
  CHECK(covered.corroded_fraction == 1);
  CHECK(covered.mass_loss_g_per_m2 == 0);
}

TEST_CASE("Thesis mode: ages are nested: nothing heals, from one year to the next up to 100") {
  // PROVES: corrosion.md 5.1, check 4.
  for (const bool uneven : {false, true}) {
    GrowthOptions options = thesis(128, Corrosivity::kHigh, 100);
    if (uneven) {
      options.material = waves();
      options.events.conversion_removes = true;
    }
    std::vector<double> ages(100);
    std::iota(ages.begin(), ages.end(), 1.0);
    Sheet last;
    const auto growth = grown(options);
    REQUIRE(growth->each(ages, [&](const Sheet& sheet) {
      for (std::size_t i = 0; i < last.height.size(); ++i) {
        REQUIRE(sheet.height[i] <= last.height[i]);
        REQUIRE(sheet.state[i] >= last.state[i]);
      }
      for (std::size_t i = 0; i < sheet.cells(); ++i) {
        const bool born = static_cast<double>((*sheet.birth_years)[i]) <= sheet.age_years * (1 + 1e-6);
        const bool corroded = sheet.state[i] >= CellState::kSpreading;
        if (born != corroded) {
          // Float births may fall on the wrong side of an age only by their rounding.
          REQUIRE(static_cast<double>((*sheet.birth_years)[i]) == Approx(sheet.age_years).epsilon(2e-6));
        }
      }
      last = sheet;
    }));
    CHECK(hash(last) == hash(*growth->at(100)));
  }
}

TEST_CASE("Thesis mode: an age is the same whatever the oldest age of its run, and in a series or alone") {
  const auto young = grown(thesis(96, Corrosivity::kMedium, 7));
  const auto old = grown(thesis(96, Corrosivity::kMedium, 60));
  CHECK(hash(*young->at(7)) == hash(*old->at(7)));
  CHECK(hash(*young->at(3.3)) == hash(*old->at(3.3)));
  const double ages[] = {0, 0, 1.5, 3.3, 3.3, 3.31, 7};
  std::size_t next = 0;
  REQUIRE(old->each(ages, [&](const Sheet& sheet) {
    CHECK(sheet.age_years == ages[next]);
    const Sheet alone = *old->at(ages[next++]);
    CHECK(hash(sheet) == hash(alone));
    CHECK(sheet.events == alone.events);
    CHECK(sheet.hole_fraction == alone.hole_fraction);
  }));
  CHECK(next == 7);
}

TEST_CASE("Thesis mode: more starting points corrode more area and less depth, at equal mass") {
  // PROVES: corrosion.md 5.1, check 5; means of eight seeds, no late seeds.
  double corroded = 0;
  double deepening = 1;
  for (const std::uint32_t points : {10U, 30U, 50U, 100U, 150U}) {
    double more = 0;
    double less = 0;
    for (std::uint64_t seed = 1; seed <= 8; ++seed) {
      GrowthOptions options = thesis(256, Corrosivity::kLow, 1);
      options.starting_points = points;
      options.late_points = 0;
      options.seed = seed;
      const Sheet sheet = *grown(options)->at(1);
      more += sheet.corroded_fraction / 8;
      less += sheet.state3_fraction / 8;
    }
    CHECK(more > corroded);
    CHECK(less < deepening);
    corroded = more;
    deepening = less;
  }
}

TEST_CASE("Thesis mode: without late seeds only the starting points begin; with them more patches do") {
  const auto patches = [](const Sheet& sheet) {
    std::vector<std::uint8_t> seen(sheet.cells());
    std::size_t count = 0;
    std::vector<std::uint32_t> open;
    for (std::uint32_t i = 0; i < sheet.cells(); ++i) {
      if (seen[i] != 0 || sheet.state[i] < CellState::kSpreading) {
        continue;
      }
      ++count;
      open.push_back(i);
      seen[i] = 1;
      while (!open.empty()) {
        const std::uint32_t cell = open.back();
        open.pop_back();
        visit_neighbours(cell, static_cast<std::uint32_t>(sheet.side), Border::kToroidal,
                         [&](std::uint32_t other) {
                           if (seen[other] == 0 && sheet.state[other] >= CellState::kSpreading) {
                             seen[other] = 1;
                             open.push_back(other);
                           }
                         });
      }
    }
    return count;
  };
  GrowthOptions options = thesis(256, Corrosivity::kLow, 2);
  options.starting_points = 5;
  options.late_points = 0;
  CHECK(patches(*grown(options)->at(2)) <= 5);
  // 54 are expected up to 136 g/m^2; some fall on rust, some still wait, some have met others.
  options.late_points = 400;
  const std::size_t with = patches(*grown(options)->at(2));
  CHECK(with > 10);
  CHECK(with < 5 + 54 + 4 * 8);
}

TEST_CASE("Thesis mode: holes are where nothing is left, and none is ever hit again") {
  // PROVES: corrosion.md 5.1, check 6.
  const auto growth = grown(thesis(64, Corrosivity::kVeryHigh, 12));
  std::vector<double> ages(49);
  for (std::size_t i = 0; i < ages.size(); ++i) {
    ages[i] = 0.25 * static_cast<double>(i);
  }
  std::size_t holes = 0;
  REQUIRE(growth->each(ages, [&](const Sheet& sheet) {
    CHECK(broken_rule(sheet) == "");
    // Each hit takes a twentieth (rounded up to units, so the twentieth takes what is left): as many hits as
    // the heights tell were made, so none was spent on a hole.
    std::uint64_t hits = 0;
    for (const float height : sheet.height) {
      hits += static_cast<std::uint64_t>(std::ceil((1 - static_cast<double>(height)) * 20 - 1e-4));
    }
    CHECK(hits == sheet.events);
    const auto now =
        static_cast<std::size_t>(std::count(sheet.state.begin(), sheet.state.end(), CellState::kHole));
    CHECK(now >= holes);
    holes = now;
  }));
  CHECK(holes > 1000);

  // The whole loss is less than one cell's metal.
  GrowthOptions thick = thesis(64, Corrosivity::kVeryLow, 20);
  thick.thickness_mm = 1000;
  const Sheet sheet = *grown(thick)->at(20);
  CHECK(sheet.mass_loss_g_per_m2 == Approx(sheet.target_g_per_m2).epsilon(1e-5));
  CHECK(sheet.hole_fraction == 0);

  // One bite goes right through.
  GrowthOptions thin = thesis(64, Corrosivity::kLow, 20);
  thin.events.bite = 1;
  const Sheet pierced = *grown(thin)->at(20);
  CHECK(broken_rule(pierced) == "");
  CHECK(pierced.hole_fraction == Approx(376.26 / 7800).margin(1.0 / 4096));
}

TEST_CASE("Thesis mode: the same seed gives the same bytes, on any number of threads; another seed others") {
  // PROVES: corrosion.md 5.1, check 7.
  std::vector<GrowthOptions> batch;
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    batch.push_back(thesis(96, kCorrosivities[seed % 5], 9));
    batch.back().seed = seed;
    if (seed % 3 == 0) {
      batch.back().surface = waves();
      batch.back().border = Border::kClamped;
    }
  }
  std::size_t reports = 0;
  const auto together = Growth::run_all(batch, [&](double) { ++reports; });
  CHECK(reports == batch.size());
  std::vector<std::string> hashes;
  for (std::size_t i = 0; i < batch.size(); ++i) {
    REQUIRE(together[i]);
    hashes.push_back(hash(*(*together[i])->at(9)));
    CHECK(hashes.back() == hash(*grown(batch[i])->at(9)));
  }
  std::sort(hashes.begin(), hashes.end());
  CHECK(std::adjacent_find(hashes.begin(), hashes.end()) == hashes.end());
}

TEST_CASE("Thesis mode: one growth serves several threads") {
  const auto growth = grown(thesis(128, Corrosivity::kHigh, 20));
  const std::string expected = hash(*growth->at(20));
  std::vector<std::string> found(4);
  {
    std::vector<std::jthread> threads;
    for (std::string& text : found) {
      threads.emplace_back([&] { text = hash(*growth->at(20)); });
    }
  }
  CHECK(found == std::vector<std::string>(4, expected));
}

TEST_CASE("Thesis mode: a stopped run says so, and progress rises to what was done") {
  std::stop_source source;
  double last = 0;
  bool rising = true;
  const auto stopped = Growth::run(
      thesis(512, Corrosivity::kHigh, 50),
      [&](double share) {
        rising = rising && share >= last && share <= 1;
        last = share;
        if (share > 0.5) {
          source.request_stop();
        }
      },
      source.get_token());
  REQUIRE(!stopped);
  CHECK(stopped.error().code == ErrorCode::kAborted);
  CHECK(rising);
}

TEST_CASE("Thesis mode: a bad run in a batch spoils no other") {
  std::vector<GrowthOptions> batch(3, thesis(32, Corrosivity::kLow, 5));
  batch[1].thickness_mm = 0;
  const auto results = Growth::run_all(batch);
  CHECK(results[0]);
  CHECK(!results[1]);
  CHECK(results[2]);
}

}  // namespace
}  // namespace scatter::corrosion
