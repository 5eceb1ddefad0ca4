#include "host_sdk/formats/exr_atlas.h"

#include <OpenEXR/ImfIntAttribute.h>
#include <OpenEXR/ImfStringVectorAttribute.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <exception>
#include <optional>
#include <set>
#include <tuple>
#include <utility>

#include "host_sdk/formats/dirac_share.h"
#include "host_sdk/formats/exr_tile_file.h"
#include "host_sdk/formats/exr_tile_image.h"
#include "host_sdk/formats/exr_tile_layout.h"
#include "host_sdk/formats/file_bytes.h"

namespace scatter::formats {
namespace {

using reflectance::Brdf;
using reflectance::degrees;
using reflectance::radians;
using reflectance::SpecularGridBrdf;

constexpr std::size_t kLongestName = 200;
constexpr double kSameAngle = 1e-4;
constexpr const char* kResample = "ask for resampling, or export the materials alike";

/// Width and height of the tiles that a BRDF was read from.
std::optional<std::pair<std::size_t, std::size_t>> tile_size(const Brdf& brdf) {
  const auto* specular = dynamic_cast<const SpecularGridBrdf*>(&brdf);
  if (specular == nullptr) {
    return std::nullopt;
  }
  const auto& azimuth = specular->content().azimuth;
  const auto& radial = specular->content().radial;
  const bool texels =
      std::abs(azimuth.front() - azimuth_at(0, azimuth.size())) < kSameAngle &&
      std::abs(azimuth.back() - azimuth_at(azimuth.size() - 1, azimuth.size())) < kSameAngle &&
      std::abs(radial.front() - radial_at(0, radial.size())) < kSameAngle &&
      std::abs(radial.back() - radial_at(radial.size() - 1, radial.size())) < kSameAngle;
  return texels ? std::optional(std::pair(azimuth.size(), radial.size())) : std::nullopt;
}

std::unexpected<Error> bad(const std::string& what, const char* remedy) {
  return fail(ErrorCode::kInvalidArgument, fmt::format("EXR atlas: {}", what), remedy);
}

/// What is the same for all materials whether or not they are resampled.
Status check_materials(std::span<const AtlasMaterial> materials) {
  if (materials.empty() || materials.size() > kMostTiles) {
    return bad(fmt::format("{} materials, expected 1..{}", materials.size(), kMostTiles),
               "name some materials");
  }
  std::set<std::string_view> names;
  for (const AtlasMaterial& material : materials) {
    if (material.name.empty() || material.name.size() > kLongestName || !names.insert(material.name).second) {
      return bad(fmt::format("the name '{}' is empty, too long or there twice", material.name),
                 "give each material a name of its own");
    }
    const Brdf& first = *materials.front().brdf;
    if (material.brdf->type() != first.type()) {
      return bad(fmt::format("one of '{}' and '{}' is a BRDF, the other a BTDF", materials.front().name,
                             material.name),
                 "put reflection and transmission into an atlas each");
    }
    if (material.brdf->channels() != first.channels()) {
      return bad(
          fmt::format("'{}' has {} channels, '{}' {}", materials.front().name, first.channels(),
                      material.name, material.brdf->channels()),
          "bring them to as many channels first: 'scatter convert FILE ONE.exr --channel 0' writes one "
          "channel alone, 'scatter merge' makes several of files of one");
    }
    if (Status status = check_not_dirac_alone(*material.brdf, "atlas"); !status) {
      return fail(status.error().code, fmt::format("EXR atlas: '{}': {}", material.name, status.error().what),
                  status.error().remedy);
    }
  }
  return {};
}

/// Without resampling: incidences and tile sizes agree.
Status check_agreement(std::span<const AtlasMaterial> materials, const std::vector<double>& theta_i,
                       std::size_t width, std::size_t height) {
  for (const AtlasMaterial& material : materials) {
    const OwnIncidences own = own_incidences(*material.brdf);
    const auto same = [](double a, double b) { return std::abs(a - b) < kSameAngle; };
    if (!own.theta_i.empty() && !std::ranges::equal(own.theta_i, theta_i, same)) {
      return bad(
          fmt::format("'{}' has {} incidences up to {:.6g} deg, expected {} up to {:.6g} deg as the first",
                      material.name, own.theta_i.size(), degrees(own.theta_i.back()), theta_i.size(),
                      degrees(theta_i.back())),
          kResample);
    }
    if (const auto size = tile_size(*material.brdf); size && *size != std::pair(width, height)) {
      return bad(fmt::format("'{}' has tiles of {} x {}, expected {} x {}", material.name, size->first,
                             size->second, width, height),
                 kResample);
    }
  }
  return {};
}

}  // namespace

Result<std::string> encode_exr_atlas(std::span<const AtlasMaterial> materials, const AtlasOptions& options) {
  if (Status status = check_materials(materials); !status) {
    return std::unexpected(status.error());
  }
  const Brdf& first = *materials.front().brdf;
  std::vector<double> theta_i = options.tiles.theta_i;
  if (theta_i.empty()) {
    theta_i = own_incidences(first).theta_i;
  }
  if (theta_i.empty()) {
    theta_i = {0, radians(20), radians(40), radians(60)};
  }
  if (options.tiles.texture_3d) {
    theta_i = texture_incidences(theta_i);
  }
  std::size_t width = options.tiles.width;
  std::size_t height = options.tiles.height;
  if (!options.resample) {
    if (const auto size = tile_size(first)) {
      std::tie(width, height) = *size;
    }
    if (Status status = check_agreement(materials, theta_i, width, height); !status) {
      return std::unexpected(status.error());
    }
  }
  for (const AtlasMaterial& material : materials) {
    if (own_incidences(*material.brdf).rotation.size() > 1) {
      return bad(fmt::format("'{}' has several sample rotations", material.name),
                 "write its tiles, or the native EXR grid");
    }
  }
  const auto side_is_good = [](std::size_t side) { return side >= 1 && side <= kLargestTileSide; };
  const std::size_t inner_columns =
      options.columns != 0 ? options.columns : near_square_columns(materials.size(), width, height);
  const std::size_t inner_rows = (materials.size() + inner_columns - 1) / inner_columns;
  const std::size_t columns =
      options.tiles.columns != 0
          ? options.tiles.columns
          : near_square_columns(theta_i.size(), width * inner_columns, height * inner_rows);
  const std::size_t rows = (theta_i.size() + columns - 1) / columns;
  if (!side_is_good(width) || !side_is_good(height) || theta_i.size() > kMostTiles || columns > kMostTiles ||
      inner_columns > kMostTiles || (first.channels() != 1 && first.channels() != 3) ||
      static_cast<double>(width * height) * static_cast<double>(columns * rows) *
              static_cast<double>(inner_columns * inner_rows) >
          static_cast<double>(kMostTilePixels)) {
    return bad(
        fmt::format("{} channels, {} x {} tiles of {} x {} materials of {} x {} texels; expected 1 or 3 "
                    "channels and at most {} pixels",
                    first.channels(), columns, rows, inner_columns, inner_rows, width, height,
                    kMostTilePixels),
        "choose smaller tiles or fewer materials");
  }
  TileImage::Layout layout{.width = columns * inner_columns * width,
                           .height = rows * inner_rows * height,
                           .tile_width = width,
                           .tile_height = height,
                           .channels = first.channels(),
                           .half_precision = options.tiles.half_precision,
                           .sigma = false};
  std::vector<TileIncidence> incidences;
  std::vector<TileImage::Tile> tiles;
  for (std::size_t t = 0; t < theta_i.size(); ++t) {
    incidences.push_back({0, theta_i[t]});
    for (std::size_t m = 0; m < materials.size(); ++m) {
      tiles.push_back({materials[m].brdf, incidences.back(),
                       (t % columns * inner_columns + m % inner_columns) * width,
                       (t / columns * inner_rows + m / inner_columns) * height});
    }
  }
  std::vector<std::string> names;
  for (const AtlasMaterial& material : materials) {
    names.push_back(material.name);
    layout.sigma = layout.sigma || has_uncertainty(*material.brdf, incidences);
  }
  try {
    TileImage image(layout);
    image.fill(tiles);
    Imf::Header header = tile_header(layout, first,
                                     {.tiles = incidences,
                                      .columns = columns,
                                      .method = options.tiles.method,
                                      .symmetry = "isotropic",
                                      .metadata = {}});
    header.insert("bsdfAtlasColumns", Imf::IntAttribute(static_cast<int>(inner_columns)));
    header.insert("bsdfAtlasNames", Imf::StringVectorAttribute(names));
    return image.encode(std::move(header));
  } catch (const std::exception& error) {
    return fail(ErrorCode::kInternal, fmt::format("EXR encoder: {}", error.what()), "report this");
  }
}

Status write_exr_atlas(std::span<const AtlasMaterial> materials, const std::filesystem::path& path,
                       const AtlasOptions& options) {
  const auto bytes = encode_exr_atlas(materials, options);
  return bytes ? write_file(path, *bytes) : std::unexpected(bytes.error());
}

Result<std::vector<AtlasEntry>> decode_exr_atlas(std::string_view bytes, std::string_view name) {
  const auto file = decode_exr_tile_file(bytes, name);
  if (!file) {
    return std::unexpected(file.error());
  }
  std::vector<AtlasEntry> entries;
  for (std::size_t k = 0; k < std::max<std::size_t>(1, file->atlas_names.size()); ++k) {
    auto brdf = file->brdf(k, name);
    if (!brdf) {
      return std::unexpected(brdf.error());
    }
    entries.push_back({file->atlas_names.empty() ? "" : file->atlas_names[k], std::move(*brdf)});
  }
  return entries;
}

Result<std::vector<AtlasEntry>> read_exr_atlas(const std::filesystem::path& path) {
  const auto bytes = read_file(path);
  if (!bytes) {
    return std::unexpected(bytes.error());
  }
  return decode_exr_atlas(*bytes, path.string());
}

}  // namespace scatter::formats
