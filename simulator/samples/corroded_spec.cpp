#include "simulator/samples/corroded_spec.h"

#include <fmt/format.h>

#include <bit>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <map>
#include <mutex>
#include <utility>

#include "host_sdk/images/decode_image.h"
#include "simulator/samples/spec_keys.h"
#include "simulator/samples/textured_spec.h"

namespace scatter::simulator {
namespace {

using corrosion::GrowthOptions;
using corrosion::Map;

constexpr std::uint64_t kMostSide = 16384;
/// Files that hold more are no maps of a sheet.
constexpr std::uintmax_t kMostBytes = std::uintmax_t{1} << 31U;

/// A map from a number, or from a picture's luminance.
Result<Map> read_map(std::string_view text) {
  const std::filesystem::path path(text);
  std::error_code error;
  const std::uintmax_t size = std::filesystem::file_size(path, error);
  std::ifstream file(path, std::ios::binary);
  if (error || !file) {
    return fail(ErrorCode::kNotFound, fmt::format("cannot read the map {}", text),
                "give a number, or the path of an EXR or PNG picture without commas");
  }
  if (size > kMostBytes) {
    return fail(ErrorCode::kResourceExhausted,
                fmt::format("the map {} has {} bytes, expected at most {}", text, size, kMostBytes),
                "give a smaller picture");
  }
  std::string bytes(size, '\0');
  file.read(bytes.data(), static_cast<std::streamsize>(size));
  if (!file) {
    return fail(ErrorCode::kDataLoss, fmt::format("the map {} ends early", text), "check the disk");
  }
  auto image = images::decode_image(bytes, text, images::Encoding::kLinear);
  if (!image) {
    return std::unexpected(std::move(image.error()));
  }
  images::Image grey = images::luminance(*image);
  return Map{.width = grey.width, .height = grey.height, .values = std::move(grey.values)};
}

void take_map(SpecKeys& keys, std::string_view key, double highest, Map& map) {
  const auto text = keys.text(key);
  if (!text) {
    return;
  }
  double value = 0;
  const auto [end, problem] = std::from_chars(text->data(), text->data() + text->size(), value);
  if (problem == std::errc{} && end == text->data() + text->size()) {
    keys.number(key, 0, highest, value);
    map = {1, 1, {static_cast<float>(value)}};
    return;
  }
  auto read = read_map(*text);
  if (read) {
    map = std::move(*read);
  } else {
    keys.reject(std::move(read.error()));
  }
}

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

void take_grid(SpecKeys& keys, GrowthOptions& growth) {
  // A sheet no larger than the spot would be lit twice; a larger one than this needs too fine a grid.
  const double largest = std::floor(static_cast<double>(kMostSide) * kSpotMm / kCellsPerSpot);
  keys.number("extent_mm", kSpotMm, largest, growth.extent_mm);
  const std::size_t least =
      static_cast<std::size_t>(std::ceil(growth.extent_mm * kCellsPerSpot / kSpotMm - 1e-9));
  std::uint64_t side = side_for(growth.extent_mm);
  keys.whole("side", 8, kMostSide, side);
  if (side < least) {
    keys.reject("side",
                fmt::format("{}..{}: the spot of {} mm must have {} cells across, at an extent of {} mm",
                            least, kMostSide, kSpotMm, kCellsPerSpot, growth.extent_mm));
  }
  growth.side = side;
  if (growth.starting_points > side * side) {
    keys.reject("starting_points", fmt::format("1..{}, the cells of the sheet", side * side));
  }
}

void take_optics(SpecKeys& keys, CorrodedSample& sample) {
  keys.number("metal_alpha", 0.01, 1, sample.optics.metal_alpha);
  sample.appearance.metal_roughness = static_cast<float>(sample.optics.metal_alpha);
  if (const auto backing = keys.text("backing"); backing && *backing != "black") {
    keys.number("backing", 0, 1, sample.optics.backing);
  }
  if (const auto spot = keys.text("spot")) {
    sample.place = *spot == "whole" ? std::nullopt : place_from(*spot);
    if (*spot != "whole" && !sample.place) {
      keys.reject("spot", "u/v, each 0..1 from the sheet's left and top edge, or whole");
    }
  }
}

/// FNV-1a over the values' bytes.
std::uint64_t hash_of(const Map& map) noexcept {
  std::uint64_t hash = 0xCBF29CE484222325U;
  for (const float value : map.values) {
    hash = (hash ^ std::bit_cast<std::uint32_t>(value)) * 0x100000001B3U;
  }
  return hash;
}

/// Equal for samples that are the same sheet.
std::string key_of(const CorrodedSample& sample) {
  const GrowthOptions& g = sample.growth;
  std::string key = fmt::format(
      "{} {} {} {} {} {} {} {} {} {} {} {} {}", static_cast<int>(g.mode), static_cast<int>(g.corrosivity),
      static_cast<int>(g.law), g.age_years, g.starting_points, g.side, g.extent_mm, g.thickness_mm, g.seed,
      static_cast<int>(g.border), g.least_susceptibility, g.late_points.value_or(-1), g.reserve);
  for (const Map* map : {&g.surface, &g.material, &g.exposure, &g.opening}) {
    key += fmt::format(" {}x{}:{:x}", map->width, map->height, hash_of(*map));
  }
  return key + fmt::format(" {} {} {} {} {} {} {} {} {} {} {}", g.events.bite, g.events.conversion_removes,
                           g.front.depth_per_spread, g.front.skin_um, g.front.front_sigma,
                           g.front.front_length_mm, g.front.pit_sigma, g.front.pit_length_mm,
                           sample.optics.metal, sample.optics.metal_alpha, sample.optics.backing);
}

/// Sheets that somebody holds. Growing happens under the lock: who asks for the same sheet at the same time
/// gets the one that is being made.
struct LivingSheets {
  std::mutex mutex;
  std::map<std::string, std::weak_ptr<const TexturedSheet>> by_key;
  std::size_t grown = 0;
};

LivingSheets& living_sheets() {
  static LivingSheets sheets;
  return sheets;
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

std::size_t side_for(double extent_mm) noexcept {
  return std::bit_ceil(static_cast<std::size_t>(std::ceil(extent_mm * kCellsPerSpot / kSpotMm - 1e-9)));
}

Result<CorrodedSample> parse_corroded(std::string_view spec) {
  CorrodedSample sample;
  SpecKeys keys(spec);
  take_growth(keys, sample.growth);
  take_grid(keys, sample.growth);
  take_optics(keys, sample);
  if (const Status read = keys.finish(); !read) {
    return std::unexpected(read.error());
  }
  return sample;
}

Result<std::shared_ptr<const TexturedSheet>> corroded_sheet(const CorrodedSample& sample) {
  LivingSheets& living = living_sheets();
  const std::string key = key_of(sample);
  const std::scoped_lock lock(living.mutex);
  if (auto sheet = living.by_key[key].lock()) {
    return sheet;
  }
  auto sheet = grow(sample);
  if (sheet) {
    ++living.grown;
    std::erase_if(living.by_key, [](const auto& entry) { return entry.second.expired(); });
    living.by_key[key] = *sheet;
  }
  return sheet;
}

std::size_t sheets_grown() noexcept {
  LivingSheets& living = living_sheets();
  const std::scoped_lock lock(living.mutex);
  return living.grown;
}

}  // namespace scatter::simulator
