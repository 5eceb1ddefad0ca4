// Mode::kThesis: against the full scan, against the bare cost of memory, and a series of ages against one.
#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "simulator/corrosion/growth.h"
#include "simulator/random/bulk.h"
#include "tests/bench/bench.h"
#include "tests/reference/full_scan_corrosion.h"

namespace scatter::bench {
namespace {

using corrosion::Growth;
using corrosion::GrowthOptions;
using corrosion::Sheet;

/// The case of corrosion.md 4: class low, 20 points, 20 years, even maps.
GrowthOptions case_of(std::size_t side) {
  GrowthOptions options;
  options.mode = corrosion::Mode::kThesis;
  options.corrosivity = corrosion::Corrosivity::kLow;
  options.starting_points = 20;
  options.age_years = 20;
  options.side = side;
  return options;
}

std::shared_ptr<const Growth> grown(std::size_t side) {
  return *Growth::run(case_of(side));
}

std::uint64_t events_of(std::size_t side) {
  return grown(side)->at(20)->events;
}

/// Ours several times before and after each run of the scan, which takes seconds to a minute.
std::vector<Figure> against_full_scan(std::size_t side, int rounds) {
  std::vector<double> ours;
  std::vector<double> theirs;
  std::uint64_t visits = 0;
  const auto run_ours = [&] {
    for (int i = 0; i < 15; ++i) {
      ours.push_back(cpu_seconds_of([&] { keep(grown(side).get()); }));
    }
  };
  for (int round = 0; round < rounds; ++round) {
    run_ours();
    reference::FullScanCorrosion scan(case_of(side));
    theirs.push_back(cpu_seconds_of([&] { scan.run(); }));
    visits = scan.visits();
    run_ours();
  }
  const std::string name = fmt::format("corrosion.{}", side);
  const double scan_seconds = median(theirs);
  return {make_figure(name, median(ours), "s", "full scan per pass", scan_seconds, Better::kLower),
          make_figure(name + ".scan", scan_seconds / static_cast<double>(visits) * 1e9, "ns/visit",
                      "most that the scan may cost", 4, Better::kLower)};
}

/// One random draw and one random read-modify-write of an array of floats per event.
void touch(std::vector<float>& cells, std::uint64_t events) {
  const simulator::RandomKey key{1, simulator::Purpose::kCorrosion, 0};
  simulator::BulkWords words;
  for (std::uint64_t done = 0; done < events; done += words.size()) {
    simulator::draw_bulk(key, static_cast<std::uint32_t>(done / words.size()), words);
    for (const std::uint32_t word : words) {
      cells[static_cast<std::uint64_t>(word) * cells.size() >> 32U] -= 1e-6F;
    }
  }
}

std::vector<Figure> against_memory() {
  constexpr std::size_t kSides[] = {256, 2048};
  double cost[2] = {};
  double floor = 0;
  for (std::size_t i = 0; i < 2; ++i) {
    const std::size_t side = kSides[i];
    const std::uint64_t events = events_of(side);
    std::vector<float> cells(side * side, 1.0F);
    std::vector<double> ours;
    std::vector<double> theirs;
    for (int round = 0; round < (side < 1000 ? 101 : 9); ++round) {
      ours.push_back(cpu_seconds_of([&] { keep(grown(side).get()); }));
      theirs.push_back(cpu_seconds_of([&] { touch(cells, events); }));
    }
    cost[i] = median(ours) / static_cast<double>(events) * 1e9;
    floor = median(theirs) / static_cast<double>(events) * 1e9;
  }
  return {make_figure("corrosion.2048", cost[1], "ns/event", "one random draw and read-modify-write", floor,
                      Better::kLower),
          make_figure("corrosion.2048.growth", cost[1], "ns/event", "256 x 256", cost[0], Better::kLower)};
}

std::vector<Figure> series() {
  std::vector<Figure> figures;
  std::vector<double> ages;
  for (int age = 1; age <= 100; ++age) {
    ages.push_back(age);
  }
  for (const std::size_t side : {256U, 2048U}) {
    GrowthOptions options = case_of(side);
    options.age_years = 100;
    std::vector<double> all;
    std::vector<double> last;
    for (int round = 0; round < 7; ++round) {
      last.push_back(cpu_seconds_of([&] { keep((*Growth::run(options))->at(100)->events); }));
      all.push_back(cpu_seconds_of([&] {
        keep((*Growth::run(options))->each(ages, [](const Sheet& sheet) { keep(sheet.events); }).has_value());
      }));
    }
    figures.push_back(make_figure(fmt::format("corrosion.series.{}", side), median(all), "s",
                                  "a run and its last age alone", median(last), Better::kLower));
  }
  return figures;
}

const Benchmark kSmall{"corrosion.256", [] { return against_full_scan(256, 3); }};
const Benchmark kMiddle{"corrosion.512", [] { return against_full_scan(512, 1); }};
const Benchmark kLarge{"corrosion.2048", [] { return against_memory(); }};
const Benchmark kSeries{"corrosion.series", [] { return series(); }};

}  // namespace
}  // namespace scatter::bench
