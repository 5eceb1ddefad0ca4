#include "host_sdk/formats/exr_tile_file.h"

#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfFloatVectorAttribute.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfInputFile.h>
#include <OpenEXR/ImfIntAttribute.h>
#include <OpenEXR/ImfStringAttribute.h>
#include <OpenEXR/ImfStringVectorAttribute.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <exception>

#include "host_sdk/formats/exr_tile_layout.h"
#include "host_sdk/images/exr_header.h"
#include "host_sdk/images/exr_stream.h"
#include "host_sdk/images/exr_threads.h"

namespace scatter::formats {
namespace {

using reflectance::Origin;
using reflectance::radians;
using reflectance::ScatterType;
using reflectance::SpecularGridBrdf;

constexpr const char* kRemedy = "export the file again";
/// Side of the blocks in which images are turned.
constexpr std::size_t kBlock = 16;

std::unexpected<Error> bad(std::string_view name, const std::string& what) {
  return fail(ErrorCode::kInvalidArgument, fmt::format("{}: {}", name, what), kRemedy);
}

/// Incidences and rotations of the tiles: each rotation has the same incidences in the same order.
Status read_incidences(const Imf::Header& header, std::string_view name, ExrTileFile& out) {
  const auto* angles = header.findTypedAttribute<Imf::FloatVectorAttribute>("bsdfTileAngles");
  const auto* columns = header.findTypedAttribute<Imf::IntAttribute>("bsdfTileColumns");
  if (angles == nullptr || columns == nullptr) {
    return bad(name, "has no attributes bsdfTileAngles and bsdfTileColumns");
  }
  const std::vector<float>& theta = angles->value();
  if (theta.empty() || theta.size() > kMostTiles || columns->value() < 1 ||
      columns->value() > static_cast<int>(kMostTiles)) {
    return bad(name, fmt::format("{} tiles in {} columns, expected 1..{}", theta.size(), columns->value(),
                                 kMostTiles));
  }
  out.columns = static_cast<std::size_t>(columns->value());
  std::vector<float> rotation(theta.size());
  if (const auto* given = header.findTypedAttribute<Imf::FloatVectorAttribute>("bsdfTileRotations");
      given != nullptr) {
    rotation = given->value();
  }
  if (rotation.size() != theta.size()) {
    return bad(name, fmt::format("{} rotations for {} tiles", rotation.size(), theta.size()));
  }
  const auto per_rotation = static_cast<std::size_t>(
      std::ranges::find_if(rotation, [&](float r) { return r != rotation.front(); }) - rotation.begin());
  if (per_rotation == 0) {
    return bad(name, "the rotation of tile 0 is not a number");
  }
  for (std::size_t k = 0; k < theta.size(); ++k) {
    // Written so that NaN is refused too.
    const bool fits = theta[k] == theta[k % per_rotation] && rotation[k] == rotation[k - k % per_rotation];
    if (!fits || theta.size() % per_rotation != 0) {
      return bad(name,
                 fmt::format("tile {} shows theta_i {} at rotation {}, expected the same incidences for "
                             "each rotation",
                             k, theta[k], rotation[k]));
    }
    if (k < per_rotation) {
      out.theta_i.push_back(radians(static_cast<double>(theta[k])));
    }
    if (k % per_rotation == 0) {
      out.rotation.push_back(radians(static_cast<double>(rotation[k])));
    }
  }
  return {};
}

Status read_sizes(const Imf::Header& header, std::string_view name, ExrTileFile& out) {
  std::size_t atlas_rows = 1;
  if (const auto* names = header.findTypedAttribute<Imf::StringVectorAttribute>("bsdfAtlasNames");
      names != nullptr) {
    const auto* columns = header.findTypedAttribute<Imf::IntAttribute>("bsdfAtlasColumns");
    if (columns == nullptr || columns->value() < 1 || columns->value() > static_cast<int>(kMostTiles) ||
        names->value().empty() || names->value().size() > kMostTiles) {
      return bad(name,
                 fmt::format("an atlas of {} materials in {} columns, expected 1..{}", names->value().size(),
                             columns == nullptr ? 0 : columns->value(), kMostTiles));
    }
    out.atlas_names = names->value();
    out.atlas_columns = static_cast<std::size_t>(columns->value());
    atlas_rows = (out.atlas_names.size() + out.atlas_columns - 1) / out.atlas_columns;
  }
  const Imath::Box2i& window = header.dataWindow();
  const auto width = static_cast<std::size_t>(std::int64_t{window.max.x} - window.min.x + 1);
  const auto height = static_cast<std::size_t>(std::int64_t{window.max.y} - window.min.y + 1);
  const std::size_t tiles = out.theta_i.size() * out.rotation.size();
  const std::size_t rows = (tiles + out.columns - 1) / out.columns * atlas_rows;
  const std::size_t columns = out.columns * out.atlas_columns;
  out.tile_width = width / columns;
  out.tile_height = height / rows;
  out.stride = width;
  if (out.tile_width * columns != width || out.tile_height * rows != height || out.tile_width == 0 ||
      out.tile_height == 0) {
    return bad(name, fmt::format("{} x {} pixels do not divide into {} columns and {} rows", width, height,
                                 columns, rows));
  }
  return {};
}

void read_attributes(const Imf::Header& header, SpecularGridBrdf::Content& content) {
  if (const auto* type = header.findTypedAttribute<Imf::StringAttribute>("bsdfType");
      type != nullptr && type->value() == "BTDF") {
    content.type = ScatterType::kBtdf;
  }
  for (const auto& [attribute, key] :
       {std::pair("bsdfMethod", "method"), std::pair("bsdfResampled", "resampled")}) {
    if (const auto* text = header.findTypedAttribute<Imf::StringAttribute>(attribute); text != nullptr) {
      content.metadata[key] = text->value();
    }
  }
  if (const auto* nm = header.findTypedAttribute<Imf::FloatVectorAttribute>("bsdfWavelengths");
      nm != nullptr) {
    content.wavelengths_nm = nm->value();
  }
  for (auto it = header.begin(); it != header.end(); ++it) {
    const std::string_view key = it.name();
    const auto* text = dynamic_cast<const Imf::StringAttribute*>(&it.attribute());
    if (text != nullptr && key.starts_with(kTileMetadataPrefix)) {
      content.metadata.emplace(key.substr(kTileMetadataPrefix.size()), text->value());
    }
  }
}

Status read_planes(Imf::InputFile& file, std::string_view name, std::size_t file_size, ExrTileFile& out) {
  const Imf::Header& header = file.header();
  const Imf::ChannelList& list = header.channels();
  const std::size_t channels = list.findChannel("Y") != nullptr ? 1 : 3;
  const auto names = tile_channel_names(channels);
  bool sigma = true;
  for (const std::string& channel : names) {
    if (list.findChannel(channel) == nullptr) {
      return bad(name, fmt::format("no channel {}, expected Y or R, G, B", channel));
    }
    sigma = sigma && list.findChannel("sigma." + channel) != nullptr;
  }
  std::size_t planes = 0;
  for (auto it = list.begin(); it != list.end(); ++it, ++planes) {
    if (it.channel().xSampling != 1 || it.channel().ySampling != 1) {
      return bad(name, fmt::format("channel {} is subsampled", it.name()));
    }
  }
  if (!images::can_hold(header, planes, file_size)) {
    return fail(ErrorCode::kDataLoss,
                fmt::format("{}: {}", name, images::ends_early(header, planes, file_size)), kRemedy);
  }
  const Imath::Box2i& window = header.dataWindow();
  const std::size_t pixels = out.stride * (static_cast<std::size_t>(window.max.y - window.min.y) + 1);
  Imf::FrameBuffer buffer;
  const auto attach = [&](const std::string& channel, std::vector<float>& plane) {
    plane.resize(pixels);
    buffer.insert(channel, Imf::Slice::Make(Imf::FLOAT, plane.data(), window, sizeof(float),
                                            sizeof(float) * out.stride));
  };
  out.value.resize(channels);
  out.sigma.resize(sigma ? channels : 0);
  for (std::size_t c = 0; c < channels; ++c) {
    attach(names[c], out.value[c]);
    if (sigma) {
      attach("sigma." + names[c], out.sigma[c]);
    }
  }
  if (list.findChannel("origin") != nullptr) {
    attach("origin", out.origin);
  }
  file.setFrameBuffer(buffer);
  file.readPixels(window.min.y, window.max.y);
  return {};
}

Result<ExrTileFile> decode(std::string_view bytes, std::string_view name) {
  const std::string text(name);
  images::ExrMemoryInput stream(bytes, text.c_str());
  Imf::InputFile file(stream, images::exr_threads());
  ExrTileFile out;
  if (Status status = read_incidences(file.header(), name, out); !status) {
    return std::unexpected(status.error());
  }
  if (Status status = read_sizes(file.header(), name, out); !status) {
    return std::unexpected(status.error());
  }
  if (Status status = read_planes(file, name, bytes.size(), out); !status) {
    return std::unexpected(status.error());
  }
  read_attributes(file.header(), out.common);
  return out;
}

/// Reorders an image plane, tile by tile, into [rotation][incidence][azimuth][radial].
std::vector<float> untile(const std::vector<float>& plane, const ExrTileFile& file, std::size_t inner) {
  const std::size_t tiles = file.theta_i.size() * file.rotation.size();
  const std::size_t inner_rows =
      file.atlas_names.empty() ? 1 : (file.atlas_names.size() + file.atlas_columns - 1) / file.atlas_columns;
  std::vector<float> out(tiles * file.tile_width * file.tile_height);
  float* at = out.data();
  for (std::size_t tile = 0; tile < tiles; ++tile) {
    const std::size_t left =
        (tile % file.columns * file.atlas_columns + inner % file.atlas_columns) * file.tile_width;
    const std::size_t top =
        (tile / file.columns * inner_rows + inner / file.atlas_columns) * file.tile_height;
    // In blocks: a column alone would fetch a cache line per texel.
    for (std::size_t i0 = 0; i0 < file.tile_width; i0 += kBlock) {
      const std::size_t i1 = std::min(file.tile_width, i0 + kBlock);
      for (std::size_t j0 = 0; j0 < file.tile_height; j0 += kBlock) {
        const std::size_t j1 = std::min(file.tile_height, j0 + kBlock);
        for (std::size_t i = i0; i < i1; ++i) {
          for (std::size_t j = j0; j < j1; ++j) {
            at[i * file.tile_height + j] = plane[(top + j) * file.stride + left + i];
          }
        }
      }
    }
    at += file.tile_width * file.tile_height;
  }
  return out;
}

}  // namespace

Result<SpecularGridBrdf> ExrTileFile::brdf(std::size_t inner, std::string_view name) const {
  SpecularGridBrdf::Content content = common;
  content.rotation = rotation;
  content.theta_i = theta_i;
  for (std::size_t i = 0; i < tile_width; ++i) {
    content.azimuth.push_back(azimuth_at(i, tile_width));
  }
  for (std::size_t j = 0; j < tile_height; ++j) {
    content.radial.push_back(radial_at(j, tile_height));
  }
  for (const auto& plane : value) {
    content.f_per_sr.push_back(untile(plane, *this, inner));
  }
  for (const auto& plane : sigma) {
    content.sigma_per_sr.push_back(untile(plane, *this, inner));
  }
  if (!origin.empty()) {
    content.origin.reserve(content.f_per_sr.front().size());
    for (const float o : untile(origin, *this, inner)) {
      if (!(o == 0 || o == 1 || o == 2 || o == 3)) {
        return bad(name, fmt::format("an origin of {}, expected 0, 1, 2 or 3", o));
      }
      content.origin.push_back(static_cast<Origin>(o));
    }
  }
  auto grid = SpecularGridBrdf::make(std::move(content));
  if (!grid) {
    return fail(ErrorCode::kDataLoss, fmt::format("{}: {}", name, grid.error().what), kRemedy);
  }
  return grid;
}

Result<ExrTileFile> decode_exr_tile_file(std::string_view bytes, std::string_view name) {
  if (Status status = images::check_exr_header(bytes, name); !status) {
    return std::unexpected(status.error());
  }
  try {
    return decode(bytes, name);
  } catch (const std::exception& error) {
    return fail(ErrorCode::kDataLoss, fmt::format("{}: {}", name, error.what()),
                "the file is damaged or incomplete: export it again");
  }
}

}  // namespace scatter::formats
