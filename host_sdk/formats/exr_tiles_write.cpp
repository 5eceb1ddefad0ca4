#include <OpenEXR/ImfStringAttribute.h>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <exception>

#include "host_sdk/formats/exr_tile_image.h"
#include "host_sdk/formats/exr_tile_layout.h"
#include "host_sdk/formats/exr_tiles.h"
#include "host_sdk/formats/file_bytes.h"
#include "host_sdk/formats/grid_to_write.h"

namespace scatter::formats {
namespace {

using reflectance::Brdf;
using reflectance::degrees;
using reflectance::radians;
using reflectance::SpecularGridBrdf;

constexpr std::size_t kMostTextureTiles = 64;
/// Incidences this close are the same [rad].
constexpr double kSameAngle = 1e-4;

std::string in_degrees(const std::vector<double>& theta_i) {
  std::vector<double> angles;
  for (const double theta : theta_i) {
    angles.push_back(std::round(degrees(theta) * 1e4) / 1e4);
  }
  return fmt::format("{}", fmt::join(angles, " "));
}

std::string symmetry_of(const Brdf& brdf, std::size_t rotations) {
  if (rotations > 1) {
    return "none";
  }
  const auto* specular = dynamic_cast<const SpecularGridBrdf*>(&brdf);
  return specular != nullptr && specular->content().plane_symmetric ? "plane" : "isotropic";
}

bool same_angles(const std::vector<double>& a, const std::vector<double>& b) {
  return std::ranges::equal(a, b, [](double x, double y) { return std::abs(x - y) < kSameAngle; });
}

}  // namespace

std::vector<double> texture_incidences(const std::vector<double>& theta_i) {
  const double last = theta_i.empty() ? 0 : theta_i.back();
  if (!(last > kSameAngle)) {
    return {0};
  }
  double step = last;
  double before = 0;
  for (const double theta : theta_i) {
    if (theta - before > kSameAngle) {
      step = std::min(step, theta - before);
    }
    before = theta;
  }
  const auto steps = static_cast<std::size_t>(
      std::clamp(std::round(last / step), 1.0, static_cast<double>(kMostTextureTiles - 1)));
  std::vector<double> out;
  for (std::size_t k = 0; k <= steps; ++k) {
    out.push_back(last * static_cast<double>(k) / static_cast<double>(steps));
  }
  return out;
}

Result<std::string> encode_exr_tiles(const Brdf& brdf, const ExrTilesOptions& options) {
  const OwnIncidences own = own_incidences(brdf);
  std::vector<double> theta_i = options.theta_i.empty() ? own.theta_i : options.theta_i;
  if (theta_i.empty()) {
    theta_i = {0, radians(20), radians(40), radians(60)};
  }
  std::string resampled;
  if (options.texture_3d) {
    const std::vector<double> even = texture_incidences(theta_i);
    if (!same_angles(even, theta_i)) {
      resampled = fmt::format("theta_i {} from {} deg", in_degrees(even), in_degrees(theta_i));
      theta_i = even;
    }
  }
  std::vector<double> rotations = options.rotations;
  if (rotations.empty()) {
    // Data of one rotation answer for any: their tiles count as unturned.
    rotations = own.rotation.size() > 1 ? own.rotation : std::vector<double>{0};
  }
  const std::size_t count = theta_i.size() * rotations.size();
  const std::size_t columns =
      options.columns != 0 ? options.columns : near_square_columns(count, options.width, options.height);
  const auto side_is_good = [](std::size_t side) { return side >= 1 && side <= kLargestTileSide; };
  const bool sizes_are_good = side_is_good(options.width) && side_is_good(options.height) &&
                              count <= kMostTiles && columns <= kMostTiles;
  TileImage::Layout layout;
  layout.channels = brdf.channels();
  layout.tile_width = options.width;
  layout.tile_height = options.height;
  layout.half_precision = options.half_precision;
  if (sizes_are_good) {
    layout.width = columns * options.width;
    layout.height = (count + columns - 1) / columns * options.height;
  }
  if ((layout.channels != 1 && layout.channels != 3) || !sizes_are_good ||
      layout.width * layout.height > kMostTilePixels) {
    return fail(
        ErrorCode::kInvalidArgument,
        fmt::format("EXR tiles: {} channels, {} tiles of {} x {} in {} columns; expected 1 or 3 channels, "
                    "sides of 1..{}, at most {} tiles and {} pixels",
                    layout.channels, count, options.width, options.height, columns, kLargestTileSide,
                    kMostTiles, kMostTilePixels),
        "choose another tile size, or write the native EXR grid");
  }
  std::vector<TileIncidence> incidences;
  std::vector<TileImage::Tile> tiles;
  for (const double rotation : rotations) {
    for (const double theta : theta_i) {
      const std::size_t k = incidences.size();
      incidences.push_back({rotation, theta});
      tiles.push_back({&brdf, incidences.back(), k % columns * options.width, k / columns * options.height});
    }
  }
  layout.sigma = has_uncertainty(brdf, incidences);
  try {
    TileImage image(layout);
    image.fill(tiles);
    Imf::Header header = tile_header(layout, brdf,
                                     {.tiles = incidences,
                                      .columns = columns,
                                      .method = options.method,
                                      .symmetry = symmetry_of(brdf, rotations.size()),
                                      .metadata = metadata_of(brdf, {.metadata = options.metadata})});
    if (!resampled.empty()) {
      header.insert("bsdfResampled", Imf::StringAttribute(resampled));
    }
    return image.encode(std::move(header));
  } catch (const std::exception& error) {
    return fail(ErrorCode::kInternal, fmt::format("EXR encoder: {}", error.what()), "report this");
  }
}

Status write_exr_tiles(const Brdf& brdf, const std::filesystem::path& path, const ExrTilesOptions& options) {
  const auto bytes = encode_exr_tiles(brdf, options);
  return bytes ? write_file(path, *bytes) : std::unexpected(bytes.error());
}

}  // namespace scatter::formats
