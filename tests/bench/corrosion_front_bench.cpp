// Mode::kPhysical: a run with one sheet against the textbook's front alone, and a series of ages against one.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <queue>
#include <string>
#include <utility>
#include <vector>

#include "simulator/corrosion/growth.h"
#include "simulator/corrosion/random_field.h"
#include "tests/bench/bench.h"

namespace scatter::bench {
namespace {

using corrosion::Growth;
using corrosion::GrowthOptions;
using corrosion::Sheet;

constexpr double kAge = 100;

/// Defaults, to an age at which most of the sheet is corroded.
GrowthOptions case_of(std::size_t side) {
  GrowthOptions options;
  options.age_years = kAge;
  options.side = side;
  return options;
}

/// Fast marching as it is taught (Sethian 1996): first order, four neighbours, a binary heap of double times,
/// over the whole of a torus.
std::vector<double> textbook_march(const std::vector<float>& slowness, std::size_t side,
                                   const std::vector<std::size_t>& starts) {
  constexpr double kNever = std::numeric_limits<double>::infinity();
  std::vector<double> times(slowness.size(), kNever);
  std::vector<bool> known(slowness.size(), false);
  using Entry = std::pair<double, std::size_t>;
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> queue;
  for (const std::size_t start : starts) {
    times[start] = 0;
    queue.emplace(0, start);
  }
  const auto moved = [side](std::size_t cell, std::size_t dx, std::size_t dy) {
    return (cell / side + dy) % side * side + (cell % side + dx) % side;
  };
  while (!queue.empty()) {
    const std::size_t cell = queue.top().second;
    queue.pop();
    if (known[cell]) {
      continue;
    }
    known[cell] = true;
    for (const std::size_t next :
         {moved(cell, 1, 0), moved(cell, side - 1, 0), moved(cell, 0, 1), moved(cell, 0, side - 1)}) {
      if (known[next]) {
        continue;
      }
      const double a = std::min(times[moved(next, 1, 0)], times[moved(next, side - 1, 0)]);
      const double b = std::min(times[moved(next, 0, 1)], times[moved(next, 0, side - 1)]);
      const auto cost = static_cast<double>(slowness[next]);
      const double time = std::abs(a - b) >= cost
                              ? std::min(a, b) + cost
                              : (a + b + std::sqrt(2 * cost * cost - (a - b) * (a - b))) / 2;
      if (time < times[next]) {
        times[next] = time;
        queue.emplace(time, next);
      }
    }
  }
  return times;
}

/// The same field of speed as the run's, in cells.
std::vector<float> slowness_of(const GrowthOptions& options) {
  const auto& front = options.front;
  const corrosion::FieldSpectrum spectrum{
      .length_mm = front.front_length_mm, .roughness = front.front_roughness, .finest_mm = front.finest_mm};
  auto fields = corrosion::random_fields(options.seed, options.side, options.extent_mm, {spectrum, spectrum});
  for (float& value : fields.values[0]) {
    value = std::exp(-static_cast<float>(front.front_sigma) * value);
  }
  return std::move(fields.values[0]);
}

std::vector<Figure> against_textbook(std::size_t side, int rounds) {
  const GrowthOptions options = case_of(side);
  const std::vector<float> slowness = slowness_of(options);
  std::vector<std::size_t> starts;
  for (std::size_t k = 1; k <= 30; ++k) {
    starts.push_back(k * 7919 * 104729 % slowness.size());
  }
  std::vector<double> ours;
  std::vector<double> theirs;
  for (int round = 0; round < rounds; ++round) {
    ours.push_back(cpu_seconds_of([&] { keep((*Growth::run(options))->at(kAge)->height.data()); }));
    theirs.push_back(cpu_seconds_of([&] { keep(textbook_march(slowness, side, starts).data()); }));
    ours.push_back(cpu_seconds_of([&] { keep((*Growth::run(options))->at(kAge)->height.data()); }));
  }
  const std::string name = fmt::format("corrosion.physical.{}", side);
  const double per_cell = 1e9 / static_cast<double>(slowness.size());
  return {make_figure(name, median(ours), "s", "textbook front alone", median(theirs), Better::kLower),
          make_figure(name + ".cell", median(ours) * per_cell, "ns", "textbook front alone",
                      median(theirs) * per_cell, Better::kLower)};
}

/// Ages 1 to 100 and the run before them, against the run and its last age.
std::vector<Figure> series() {
  std::vector<double> ages;
  for (int age = 1; age <= 100; ++age) {
    ages.push_back(age);
  }
  std::vector<double> all;
  std::vector<double> last;
  for (int round = 0; round < 7; ++round) {
    all.push_back(cpu_seconds_of([&] {
      const auto growth = *Growth::run(case_of(1024));
      double holes = 0;
      keep(growth->each(ages, [&](const Sheet& sheet) { holes += sheet.hole_fraction; }).has_value());
      keep(holes);
    }));
    last.push_back(cpu_seconds_of([&] { keep((*Growth::run(case_of(1024)))->at(kAge)->height.data()); }));
  }
  return {make_figure("corrosion.physical.series", median(all), "s", "its last age alone", median(last),
                      Better::kLower)};
}

const Benchmark kSmall{"corrosion.physical.1024", [] { return against_textbook(1024, 5); }};
const Benchmark kLarge{"corrosion.physical.2048", [] { return against_textbook(2048, 2); }};
const Benchmark kSeries{"corrosion.physical.series", [] { return series(); }};

}  // namespace
}  // namespace scatter::bench
