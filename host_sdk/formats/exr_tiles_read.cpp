#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfFloatVectorAttribute.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfInputFile.h>
#include <OpenEXR/ImfIntAttribute.h>
#include <OpenEXR/ImfStringAttribute.h>
#include <fmt/format.h>

#include <exception>

#include "host_sdk/formats/exr_header.h"
#include "host_sdk/formats/exr_stream.h"
#include "host_sdk/formats/exr_tile_layout.h"
#include "host_sdk/formats/exr_tiles.h"
#include "host_sdk/formats/file_bytes.h"

namespace scatter::formats {
namespace {

using reflectance::Origin;
using reflectance::radians;
using reflectance::ScatterType;
using reflectance::SpecularGridBrdf;

constexpr const char* kRemedy = "export the file again";

/// What the header says, checked.
struct Layout {
  std::vector<float> angles_deg;
  std::size_t columns = 0;
  std::size_t width = 0;  ///< Of a tile.
  std::size_t height = 0;
};

std::unexpected<Error> bad(std::string_view name, const std::string& what) {
  return fail(ErrorCode::kInvalidArgument, fmt::format("{}: {}", name, what), kRemedy);
}

Result<Layout> layout_of(const Imf::Header& header, std::string_view name) {
  const auto* angles = header.findTypedAttribute<Imf::FloatVectorAttribute>("bsdfTileAngles");
  const auto* columns = header.findTypedAttribute<Imf::IntAttribute>("bsdfTileColumns");
  if (angles == nullptr || columns == nullptr) {
    return bad(name, "has no attributes bsdfTileAngles and bsdfTileColumns");
  }
  Layout layout{.angles_deg = angles->value(), .columns = 0, .width = 0, .height = 0};
  if (layout.angles_deg.empty() || layout.angles_deg.size() > kMostTiles || columns->value() < 1 ||
      columns->value() > static_cast<int>(kMostTiles)) {
    return bad(name, fmt::format("{} tiles in {} columns, expected 1..{}", layout.angles_deg.size(),
                                 columns->value(), kMostTiles));
  }
  layout.columns = static_cast<std::size_t>(columns->value());
  const Imath::Box2i& window = header.dataWindow();
  const auto total_width = static_cast<std::size_t>(std::int64_t{window.max.x} - window.min.x + 1);
  const auto total_height = static_cast<std::size_t>(std::int64_t{window.max.y} - window.min.y + 1);
  const std::size_t rows = (layout.angles_deg.size() + layout.columns - 1) / layout.columns;
  layout.width = total_width / layout.columns;
  layout.height = total_height / rows;
  if (layout.width * layout.columns != total_width || layout.height * rows != total_height ||
      layout.width == 0 || layout.height == 0) {
    return bad(name, fmt::format("{} x {} pixels do not divide into {} columns and {} rows", total_width,
                                 total_height, layout.columns, rows));
  }
  return layout;
}

void read_attributes(const Imf::Header& header, SpecularGridBrdf::Content& content) {
  if (const auto* type = header.findTypedAttribute<Imf::StringAttribute>("bsdfType");
      type != nullptr && type->value() == "BTDF") {
    content.type = ScatterType::kBtdf;
  }
  if (const auto* method = header.findTypedAttribute<Imf::StringAttribute>("bsdfMethod"); method != nullptr) {
    content.metadata["method"] = method->value();
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

/// Reorders an image plane, tile by tile, into [tile][azimuth][radial].
std::vector<float> untile(const std::vector<float>& plane, const Layout& layout) {
  std::vector<float> out;
  out.reserve(layout.angles_deg.size() * layout.width * layout.height);
  const std::size_t stride = layout.width * layout.columns;
  for (std::size_t tile = 0; tile < layout.angles_deg.size(); ++tile) {
    const std::size_t left = tile % layout.columns * layout.width;
    const std::size_t top = tile / layout.columns * layout.height;
    for (std::size_t i = 0; i < layout.width; ++i) {
      for (std::size_t j = 0; j < layout.height; ++j) {
        out.push_back(plane[(top + j) * stride + left + i]);
      }
    }
  }
  return out;
}

Result<SpecularGridBrdf> decode(std::string_view bytes, std::string_view name) {
  const std::string text(name);
  ExrMemoryInput stream(bytes, text.c_str());
  Imf::InputFile file(stream, 0);
  const Imf::Header& header = file.header();
  const auto layout = layout_of(header, name);
  if (!layout) {
    return std::unexpected(layout.error());
  }
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
  if (!can_hold(header, planes, bytes.size())) {
    return fail(ErrorCode::kDataLoss,
                fmt::format("{}: claims more pixels than its {} bytes hold", name, bytes.size()), kRemedy);
  }
  const Imath::Box2i& window = header.dataWindow();
  const std::size_t stride = layout->width * layout->columns;
  const std::size_t pixels = stride * (static_cast<std::size_t>(window.max.y - window.min.y) + 1);
  std::vector<std::vector<float>> image(2 * channels + 1);
  Imf::FrameBuffer buffer;
  const auto attach = [&](const std::string& channel, std::vector<float>& plane) {
    plane.resize(pixels);
    buffer.insert(channel,
                  Imf::Slice::Make(Imf::FLOAT, plane.data(), window, sizeof(float), sizeof(float) * stride));
  };
  for (std::size_t c = 0; c < channels; ++c) {
    attach(names[c], image[c]);
    if (sigma) {
      attach("sigma." + names[c], image[channels + c]);
    }
  }
  const bool has_origin = list.findChannel("origin") != nullptr;
  if (has_origin) {
    attach("origin", image.back());
  }
  file.setFrameBuffer(buffer);
  file.readPixels(window.min.y, window.max.y);

  SpecularGridBrdf::Content content;
  read_attributes(header, content);
  content.rotation = {0};
  for (const float angle : layout->angles_deg) {
    content.theta_i.push_back(radians(static_cast<double>(angle)));
  }
  for (std::size_t i = 0; i < layout->width; ++i) {
    content.azimuth.push_back(azimuth_at(i, layout->width));
  }
  for (std::size_t j = 0; j < layout->height; ++j) {
    content.radial.push_back(radial_at(j, layout->height));
  }
  for (std::size_t c = 0; c < channels; ++c) {
    content.f_per_sr.push_back(untile(image[c], *layout));
    if (sigma) {
      content.sigma_per_sr.push_back(untile(image[channels + c], *layout));
    }
  }
  if (has_origin) {
    for (const float o : untile(image.back(), *layout)) {
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

}  // namespace

Result<SpecularGridBrdf> decode_exr_tiles(std::string_view bytes, std::string_view name) {
  if (Status status = check_exr_header(bytes, name); !status) {
    return std::unexpected(status.error());
  }
  try {
    return decode(bytes, name);
  } catch (const std::exception& error) {
    return fail(ErrorCode::kDataLoss, fmt::format("{}: {}", name, error.what()),
                "the file is damaged or incomplete: export it again");
  }
}

Result<SpecularGridBrdf> read_exr_tiles(const std::filesystem::path& path) {
  const auto bytes = read_file(path);
  if (!bytes) {
    return std::unexpected(bytes.error());
  }
  return decode_exr_tiles(*bytes, path.string());
}

}  // namespace scatter::formats
