#include "host_sdk/formats/exr_tiles.h"

#include <Imath/half.h>
#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfFloatVectorAttribute.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfIntAttribute.h>
#include <OpenEXR/ImfOutputFile.h>
#include <OpenEXR/ImfStringAttribute.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <exception>

#include "host_sdk/formats/exr_stream.h"
#include "host_sdk/formats/exr_tile_layout.h"
#include "host_sdk/formats/file_bytes.h"
#include "host_sdk/reflectance/grid_brdf.h"

namespace scatter::formats {
namespace {

using reflectance::Brdf;
using reflectance::degrees;
using reflectance::Direction;
using reflectance::GridBrdf;
using reflectance::Origin;
using reflectance::radians;
using reflectance::ScatterType;
using reflectance::SpecularGridBrdf;

constexpr int kVersion = 1;
constexpr std::size_t kLargestSide = 4096;
constexpr float kLargestHalf = 65504.0F;

/// Image of all tiles.
struct Image {
  std::size_t width = 0;
  std::size_t height = 0;
  std::vector<std::vector<float>> value;
  std::vector<std::vector<float>> sigma;  ///< Empty when unknown.
  std::vector<float> origin;
};

/// Incidences that the BRDF itself has.
Result<std::vector<double>> own_incidences(const Brdf& brdf) {
  std::vector<double> theta_i;
  bool rotated = false;
  if (const auto* grid = dynamic_cast<const GridBrdf*>(&brdf)) {
    for (const auto& part : grid->content().parts) {
      theta_i.push_back(part.theta_i);
      rotated = rotated || part.rotation_rad != grid->content().parts.front().rotation_rad;
    }
  } else if (const auto* specular = dynamic_cast<const SpecularGridBrdf*>(&brdf)) {
    theta_i = specular->content().theta_i;
    rotated = specular->content().rotation.size() > 1;
  } else {
    theta_i = {0, radians(20), radians(40), radians(60)};
  }
  if (rotated) {
    return fail(ErrorCode::kUnimplemented, "EXR tiles: several sample rotations do not fit one tile row",
                "write the native EXR grid instead");
  }
  std::ranges::sort(theta_i);
  const auto repeated = std::ranges::unique(theta_i);
  theta_i.erase(repeated.begin(), repeated.end());
  return theta_i;
}

/// Evaluates one tile at the centres of its texels.
void fill_tile(const Brdf& brdf, double theta_i, std::size_t left, std::size_t top,
               const ExrTilesOptions& options, Image& image) {
  const std::size_t channels = brdf.channels();
  const Direction omega_i = reflectance::from_spherical(theta_i, 0);
  const double side = brdf.type() == ScatterType::kBtdf ? -1 : 1;
  std::vector<double> f(channels);
  std::vector<double> random(channels);
  std::vector<double> systematic(channels);
  for (std::size_t j = 0; j < options.height; ++j) {
    for (std::size_t i = 0; i < options.width; ++i) {
      const Direction d =
          reflectance::from_spherical(radial_at(j, options.height), azimuth_at(i, options.width));
      const Direction up{d.x * omega_i.z - d.z * omega_i.x, d.y, d.x * omega_i.x + d.z * omega_i.z};
      if (up.z <= 0) {
        continue;
      }
      const Direction omega_o{up.x, up.y, side * up.z};
      const Origin origin = brdf.eval(omega_i, omega_o, f);
      const std::size_t at = (top + j) * image.width + left + i;
      image.origin[at] = static_cast<float>(origin);
      if (origin == Origin::kInvalid) {
        continue;
      }
      for (std::size_t c = 0; c < channels; ++c) {
        const auto value = static_cast<float>(f[c]);
        image.value[c][at] = options.half_precision ? std::min(value, kLargestHalf) : value;
      }
      if (!image.sigma.empty() && brdf.uncertainty(omega_i, omega_o, random, systematic)) {
        for (std::size_t c = 0; c < channels; ++c) {
          image.sigma[c][at] = static_cast<float>(std::hypot(random[c], systematic[c]));
        }
      }
    }
  }
}

/// Whether the BRDF states uncertainties, asked in the mirror direction and at the normal.
bool has_uncertainty(const Brdf& brdf, const std::vector<double>& theta_i) {
  std::vector<double> random(brdf.channels());
  std::vector<double> systematic(brdf.channels());
  const double side = brdf.type() == ScatterType::kBtdf ? -1 : 1;
  return std::ranges::any_of(theta_i, [&](double theta) {
    const Direction omega_i = reflectance::from_spherical(theta, 0);
    return brdf.uncertainty(omega_i, {-omega_i.x, 0, side * omega_i.z}, random, systematic) ||
           brdf.uncertainty(omega_i, {0, 0, side}, random, systematic);
  });
}

Imf::Header header_of(const Brdf& brdf, const std::vector<double>& theta_i, std::size_t columns,
                      const ExrTilesOptions& options, const Image& image) {
  Imf::Header header(static_cast<int>(image.width), static_cast<int>(image.height));
  header.compression() = Imf::ZIP_COMPRESSION;
  std::vector<float> angles;
  for (const double theta : theta_i) {
    angles.push_back(static_cast<float>(degrees(theta)));
  }
  header.insert("bsdfTileAngles", Imf::FloatVectorAttribute(angles));
  header.insert("bsdfMethod", Imf::StringAttribute(options.method));
  header.insert("bsdfSymmetry", Imf::StringAttribute("isotropic"));
  header.insert("bsdfType", Imf::StringAttribute(brdf.type() == ScatterType::kBtdf ? "BTDF" : "BRDF"));
  header.insert("bsdfTileColumns", Imf::IntAttribute(static_cast<int>(columns)));
  header.insert("bsdfVersion", Imf::IntAttribute(kVersion));
  header.insert("bsdfWavelengths",
                Imf::FloatVectorAttribute({brdf.wavelengths_nm().begin(), brdf.wavelengths_nm().end()}));
  if (const auto* grid = dynamic_cast<const GridBrdf*>(&brdf)) {
    for (const auto& [key, value] : grid->content().metadata) {
      if (!key.empty() && key.size() < 200) {
        header.insert(std::string(kTileMetadataPrefix) + key, Imf::StringAttribute(value));
      }
    }
  }
  for (const std::string& name : tile_channel_names(brdf.channels())) {
    header.channels().insert(name, Imf::Channel(options.half_precision ? Imf::HALF : Imf::FLOAT));
    if (!image.sigma.empty()) {
      header.channels().insert("sigma." + name, Imf::Channel(Imf::FLOAT));
    }
  }
  header.channels().insert("origin", Imf::Channel(Imf::HALF));
  return header;
}

std::string encode_image(const Image& image, const Imf::Header& header, const ExrTilesOptions& options) {
  std::vector<std::vector<half>> halves;
  halves.reserve(image.value.size() + 1);
  Imf::FrameBuffer buffer;
  const auto insert_half = [&](const std::string& name, const std::vector<float>& plane) {
    halves.emplace_back(plane.begin(), plane.end());
    buffer.insert(name, Imf::Slice(Imf::HALF, reinterpret_cast<char*>(halves.back().data()), sizeof(half),
                                   sizeof(half) * image.width));
  };
  const auto insert_float = [&](const std::string& name, const std::vector<float>& plane) {
    buffer.insert(name, Imf::Slice(Imf::FLOAT, const_cast<char*>(reinterpret_cast<const char*>(plane.data())),
                                   sizeof(float), sizeof(float) * image.width));
  };
  const auto& names = tile_channel_names(image.value.size());
  for (std::size_t c = 0; c < names.size(); ++c) {
    if (options.half_precision) {
      insert_half(names[c], image.value[c]);
    } else {
      insert_float(names[c], image.value[c]);
    }
    if (!image.sigma.empty()) {
      insert_float("sigma." + names[c], image.sigma[c]);
    }
  }
  insert_half("origin", image.origin);
  ExrMemoryOutput stream(image.origin.size());
  {
    Imf::OutputFile file(stream, header);
    file.setFrameBuffer(buffer);
    file.writePixels(static_cast<int>(image.height));
  }
  return stream.take();
}

}  // namespace

Result<std::string> encode_exr_tiles(const Brdf& brdf, const ExrTilesOptions& options) {
  const auto own = own_incidences(brdf);
  if (!own) {
    return std::unexpected(own.error());
  }
  const std::vector<double>& theta_i = options.theta_i.empty() ? *own : options.theta_i;
  const std::size_t channels = brdf.channels();
  const auto side_is_good = [](std::size_t side) { return side >= 1 && side <= kLargestSide; };
  if ((channels != 1 && channels != 3) || !side_is_good(options.width) || !side_is_good(options.height) ||
      theta_i.size() > kMostTiles || options.columns > kMostTiles) {
    return fail(ErrorCode::kInvalidArgument,
                fmt::format("EXR tiles: {} channels, {} tiles of {} x {}, expected 1 or 3 and sides of 1..{}",
                            channels, theta_i.size(), options.width, options.height, kLargestSide),
                "choose another tile size, or write the native EXR grid");
  }
  const auto tiles = static_cast<double>(theta_i.size());
  const auto near_square = static_cast<std::size_t>(
      std::ceil(std::sqrt(tiles * static_cast<double>(options.height) / static_cast<double>(options.width))));
  const std::size_t columns = std::max<std::size_t>(1, options.columns == 0 ? near_square : options.columns);
  Image image;
  image.width = columns * options.width;
  image.height = (theta_i.size() + columns - 1) / columns * options.height;
  image.value.assign(channels, std::vector<float>(image.width * image.height));
  if (has_uncertainty(brdf, theta_i)) {
    image.sigma = image.value;
  }
  image.origin.resize(image.width * image.height);
  for (std::size_t t = 0; t < theta_i.size(); ++t) {
    fill_tile(brdf, theta_i[t], t % columns * options.width, t / columns * options.height, options, image);
  }
  try {
    return encode_image(image, header_of(brdf, theta_i, columns, options, image), options);
  } catch (const std::exception& error) {
    return fail(ErrorCode::kInternal, fmt::format("EXR encoder: {}", error.what()), "report this");
  }
}

Status write_exr_tiles(const Brdf& brdf, const std::filesystem::path& path, const ExrTilesOptions& options) {
  const auto bytes = encode_exr_tiles(brdf, options);
  return bytes ? write_file(path, *bytes) : std::unexpected(bytes.error());
}

}  // namespace scatter::formats
