#include "simulator/samples/corroded_spec.h"

#include <fmt/format.h>

#include <utility>

#include "simulator/samples/spec_keys.h"
#include "simulator/samples/spec_sheet.h"

namespace scatter::simulator {
namespace {

using corrosion::GrowthOptions;
using corrosion::Map;

constexpr std::uint64_t kMostSide = 16384;

void take_growth(SpecKeys& keys, GrowthOptions& growth) {
  std::size_t mode = growth.mode == corrosion::Mode::kThesis ? 0 : 1;
  keys.choice("mode", {"thesis", "physical"}, mode);
  growth.mode = mode == 0 ? corrosion::Mode::kThesis : corrosion::Mode::kPhysical;
  auto corrosivity = static_cast<std::size_t>(growth.corrosivity);
  keys.choice("corrosivity", {"very low", "low", "medium", "high", "very high"}, corrosivity);
  growth.corrosivity = corrosion::kCorrosivities[corrosivity];
  std::size_t law = growth.law == corrosion::Law::kThesis ? 0 : 1;
  keys.choice("law", {"thesis", "iso9224"}, law);
  growth.law = law == 0 ? corrosion::Law::kThesis : corrosion::Law::kIso9224;
  std::size_t border = growth.border == corrosion::Border::kToroidal ? 0 : 1;
  keys.choice("border", {"toroidal", "clamped"}, border);
  growth.border = border == 0 ? corrosion::Border::kToroidal : corrosion::Border::kClamped;

  keys.number("age", 0, corrosion::kLongestAgeYears, growth.age_years);
  std::uint64_t points = growth.starting_points;
  keys.whole("starting_points", 1, kMostSide * kMostSide, points);
  growth.starting_points = static_cast<std::uint32_t>(points);
  keys.whole("seed", 0, ~std::uint64_t{0}, growth.seed);
  keys.number("thickness_mm", 0.001, 1000, growth.thickness_mm);
  take_map(keys, "surface", 1, growth.surface);
  take_map(keys, "material", 1, growth.material);
  take_map(keys, "exposure", 1000, growth.exposure);
  take_map(keys, "opening", 1, growth.opening);
  keys.number("least_susceptibility", 0, 1, growth.least_susceptibility);
  double late = -1;
  keys.number("late_points", 0, 1e6, late);
  if (late >= 0) {
    growth.late_points = late;
  }
  keys.number("reserve", 0, 1, growth.reserve);
  keys.number("bite", 1e-6, 1, growth.events.bite);
  keys.flag("conversion_removes", growth.events.conversion_removes);
  keys.number("depth_per_spread", 0, 1000, growth.front.depth_per_spread);
  keys.number("skin_um", 0, 1e6, growth.front.skin_um);
  keys.number("front_sigma", 0, 3, growth.front.front_sigma);
  keys.number("front_length_mm", 0.01, 1e4, growth.front.front_length_mm);
  keys.number("pit_sigma", 0, 3, growth.front.pit_sigma);
  keys.number("pit_length_mm", 0.01, 1e4, growth.front.pit_length_mm);
}

/// Equal for samples that are the same sheet.
std::string key_of(const CorrodedSample& sample) {
  const GrowthOptions& g = sample.growth;
  std::string key =
      fmt::format("corroded {} {} {} {} {} {} {} {} {} {} {} {} {}", static_cast<int>(g.mode),
                  static_cast<int>(g.corrosivity), static_cast<int>(g.law), g.age_years, g.starting_points,
                  g.side, g.extent_mm, g.thickness_mm, g.seed, static_cast<int>(g.border),
                  g.least_susceptibility, g.late_points.value_or(-1), g.reserve);
  for (const Map* map : {&g.surface, &g.material, &g.exposure, &g.opening}) {
    key += fmt::format(" {}", simulator::key_of(*map));
  }
  return key + fmt::format(" {} {} {} {} {} {} {} {} {}", g.events.bite, g.events.conversion_removes,
                           g.front.depth_per_spread, g.front.skin_um, g.front.front_sigma,
                           g.front.front_length_mm, g.front.pit_sigma, g.front.pit_length_mm,
                           simulator::key_of(sample.optics));
}

Result<std::shared_ptr<const TexturedSheet>> grow(const CorrodedSample& sample) {
  const auto growth = corrosion::Growth::run(sample.growth);
  if (!growth) {
    return std::unexpected(growth.error());
  }
  const auto sheet = (*growth)->at(sample.growth.age_years);
  if (!sheet) {
    return std::unexpected(sheet.error());
  }
  return TexturedSheet::make(corrosion::appearance(*sheet, sample.appearance), sheet->extent_mm,
                             sample.optics);
}

}  // namespace

Result<CorrodedSample> parse_corroded(std::string_view spec) {
  CorrodedSample sample;
  SpecKeys keys(spec);
  take_growth(keys, sample.growth);
  take_grid(keys, kMostSide, sample.growth.extent_mm, sample.growth.side);
  if (sample.growth.starting_points > sample.growth.side * sample.growth.side) {
    keys.reject("starting_points",
                fmt::format("1..{}, the cells of the sheet", sample.growth.side * sample.growth.side));
  }
  take_optics(keys, sample.optics);
  sample.appearance.metal_roughness = static_cast<float>(sample.optics.metal_alpha);
  take_spot(keys, sample.place);
  if (const Status read = keys.finish(); !read) {
    return std::unexpected(read.error());
  }
  return sample;
}

Result<std::shared_ptr<const TexturedSheet>> corroded_sheet(const CorrodedSample& sample) {
  return shared_sheet(key_of(sample), [&] { return grow(sample); });
}

}  // namespace scatter::simulator
