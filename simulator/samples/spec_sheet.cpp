#include "simulator/samples/spec_sheet.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <map>
#include <mutex>
#include <utility>

#include "host_sdk/images/decode_image.h"
#include "simulator/samples/textured_spec.h"

namespace scatter::simulator {
namespace {

using corrosion::Map;

/// Files that hold more are no maps of a sheet.
constexpr std::uintmax_t kMostBytes = std::uintmax_t{1} << 31U;

/// A map from a number, or from a picture's luminance.
Result<Map> read_map(std::string_view text) {
  const std::filesystem::path path(text);
  std::error_code error;
  const bool regular = std::filesystem::is_regular_file(path, error);
  const std::uintmax_t size = regular ? std::filesystem::file_size(path, error) : 0;
  std::ifstream file;
  if (regular) {  // To open a pipe would wait for somebody who writes.
    file.open(path, std::ios::binary);
  }
  if (!regular || error || !file) {
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

/// FNV-1a over the values' bytes.
std::uint64_t hash_of(const Map& map) noexcept {
  std::uint64_t hash = 0xCBF29CE484222325U;
  for (const float value : map.values) {
    hash = (hash ^ std::bit_cast<std::uint32_t>(value)) * 0x100000001B3U;
  }
  return hash;
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

}  // namespace

std::size_t side_for(double extent_mm) noexcept {
  return std::bit_ceil(static_cast<std::size_t>(std::ceil(extent_mm * kCellsPerSpot / kSpotMm - 1e-9)));
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

void take_grid(SpecKeys& keys, std::uint64_t most_side, double& extent_mm, std::size_t& side) {
  // A sheet no larger than the spot would be lit twice; a larger one than this needs too fine a grid.
  const double largest = std::floor(static_cast<double>(most_side) * kSpotMm / kCellsPerSpot);
  keys.number("extent_mm", kSpotMm, largest, extent_mm);
  const auto least = static_cast<std::size_t>(std::ceil(extent_mm * kCellsPerSpot / kSpotMm - 1e-9));
  std::uint64_t cells = std::min<std::uint64_t>(side_for(extent_mm), most_side);
  keys.whole("side", 8, most_side, cells);
  if (cells < least) {
    keys.reject("side",
                fmt::format("{}..{}: the spot of {} mm must have {} cells across, at an extent of {} mm",
                            least, most_side, kSpotMm, kCellsPerSpot, extent_mm));
  }
  side = cells;
}

void take_optics(SpecKeys& keys, SheetOptics& optics) {
  keys.number("metal_alpha", 0.01, 1, optics.metal_alpha);
  if (const auto backing = keys.text("backing"); backing && *backing != "black") {
    keys.number("backing", 0, 1, optics.backing);
  }
}

void take_spot(SpecKeys& keys, std::optional<Place>& place) {
  if (const auto spot = keys.text("spot")) {
    place = *spot == "whole" ? std::nullopt : place_from(*spot);
    if (*spot != "whole" && !place) {
      keys.reject("spot", "u/v, each 0..1 from the sheet's left and top edge, or whole");
    }
  }
}

std::string key_of(const Map& map) {
  return fmt::format("{}x{}:{:x}", map.width, map.height, hash_of(map));
}

std::string key_of(const SheetOptics& optics) {
  return fmt::format("{} {} {}", optics.metal, optics.metal_alpha, optics.backing);
}

Result<std::shared_ptr<const TexturedSheet>> shared_sheet(
    const std::string& key, const std::function<Result<std::shared_ptr<const TexturedSheet>>()>& make) {
  LivingSheets& living = living_sheets();
  const std::scoped_lock lock(living.mutex);
  if (auto sheet = living.by_key[key].lock()) {
    return sheet;
  }
  auto sheet = make();
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
