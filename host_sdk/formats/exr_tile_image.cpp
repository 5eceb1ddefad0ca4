#include "host_sdk/formats/exr_tile_image.h"

#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfFloatVectorAttribute.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfIntAttribute.h>
#include <OpenEXR/ImfOutputFile.h>
#include <OpenEXR/ImfStringAttribute.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "host_sdk/images/exr_stream.h"
#include "host_sdk/images/exr_threads.h"

namespace scatter::formats {
namespace {

using reflectance::Brdf;
using reflectance::Direction;
using reflectance::Origin;
using reflectance::ScatterType;

constexpr int kVersion = 1;
constexpr float kLargestHalf = 65504.0F;
constexpr std::size_t kLongestKey = 200;
/// Rows evaluated in one call: long enough for a batch to pay, short enough to share among cores.
constexpr std::size_t kRowsAtOnce = 10;

/// Origins as they stand in the file.
const std::array<half, 4> kOrigin{half(0.0F), half(1.0F), half(2.0F), half(3.0F)};

template <typename T>
Imf::Slice slice_of(Imf::PixelType type, const std::vector<T>& plane, std::size_t width) {
  // OpenEXR's interface lacks the const; it only reads.
  return {type, const_cast<char*>(reinterpret_cast<const char*>(plane.data())), sizeof(T), sizeof(T) * width};
}

}  // namespace

TileImage::TileImage(const Layout& layout) : layout_(layout) {
  const std::size_t pixels = layout.width * layout.height;
  (layout.half_precision ? half_.resize(layout.channels) : float_.resize(layout.channels));
  for (auto& plane : half_) {
    plane.resize(pixels);
  }
  for (auto& plane : float_) {
    plane.resize(pixels);
  }
  if (layout.sigma) {
    sigma_.assign(layout.channels, std::vector<float>(pixels));
  }
  origin_.resize(pixels);
  for (std::size_t i = 0; i < layout.tile_width; ++i) {
    cos_azimuth_.push_back(std::cos(azimuth_at(i, layout.tile_width)));
    sin_azimuth_.push_back(std::sin(azimuth_at(i, layout.tile_width)));
  }
}

void TileImage::fill(std::span<const Tile> tiles) {
  const std::size_t height = layout_.tile_height;
  const std::size_t bands = (height + kRowsAtOnce - 1) / kRowsAtOnce;
  tbb::parallel_for(std::size_t{0}, tiles.size() * bands, [&](std::size_t k) {
    const std::size_t first = k % bands * kRowsAtOnce;
    fill_rows(tiles[k / bands], first, std::min(height, first + kRowsAtOnce));
  });
}

void TileImage::fill_rows(const Tile& tile, std::size_t first, std::size_t last) {
  const std::size_t channels = layout_.channels;
  const double side = tile.brdf->type() == ScatterType::kBtdf ? -1 : 1;
  const double c_i = std::cos(tile.incidence.theta_i);
  const double s_i = std::sin(tile.incidence.theta_i);
  const double c_turn = std::cos(tile.incidence.rotation);
  const double s_turn = std::sin(tile.incidence.rotation);
  std::vector<Direction> omega_o;
  std::vector<std::size_t> at;
  omega_o.reserve((last - first) * layout_.tile_width);
  at.reserve((last - first) * layout_.tile_width);
  for (std::size_t j = first; j < last; ++j) {
    const double radial = radial_at(j, layout_.tile_height);
    const double s = std::sin(radial);
    const double c = std::cos(radial);
    for (std::size_t i = 0; i < layout_.tile_width; ++i) {
      const double x = s * cos_azimuth_[i];
      const double up = x * s_i + c * c_i;
      if (up <= 0) {
        continue;
      }
      const Direction d{x * c_i - c * s_i, s * sin_azimuth_[i], side * up};
      omega_o.push_back({c_turn * d.x - s_turn * d.y, s_turn * d.x + c_turn * d.y, d.z});
      at.push_back((tile.top + j) * layout_.width + tile.left + i);
    }
  }
  const Direction omega_i{s_i * c_turn, s_i * s_turn, c_i};
  std::vector<double> f(omega_o.size() * channels);
  std::vector<Origin> origin(omega_o.size());
  tile.brdf->eval_batch(omega_i, omega_o, f, origin);
  std::vector<double> random(channels);
  std::vector<double> systematic(channels);
  for (std::size_t k = 0; k < at.size(); ++k) {
    if (origin[k] == Origin::kInvalid) {
      continue;
    }
    origin_[at[k]] = kOrigin[static_cast<std::size_t>(origin[k])];
    for (std::size_t c = 0; c < channels; ++c) {
      const auto value = static_cast<float>(f[k * channels + c]);
      if (layout_.half_precision) {
        half_[c][at[k]] = half(std::min(value, kLargestHalf));
      } else {
        float_[c][at[k]] = value;
      }
    }
    if (layout_.sigma && tile.brdf->uncertainty(omega_i, omega_o[k], random, systematic)) {
      for (std::size_t c = 0; c < channels; ++c) {
        sigma_[c][at[k]] = static_cast<float>(std::hypot(random[c], systematic[c]));
      }
    }
  }
}

std::string TileImage::encode(Imf::Header header) const {
  const auto names = tile_channel_names(layout_.channels);
  Imf::FrameBuffer buffer;
  for (std::size_t c = 0; c < layout_.channels; ++c) {
    const Imf::PixelType type = layout_.half_precision ? Imf::HALF : Imf::FLOAT;
    header.channels().insert(names[c], Imf::Channel(type));
    buffer.insert(names[c], layout_.half_precision ? slice_of(type, half_[c], layout_.width)
                                                   : slice_of(type, float_[c], layout_.width));
    if (layout_.sigma) {
      header.channels().insert("sigma." + names[c], Imf::Channel(Imf::FLOAT));
      buffer.insert("sigma." + names[c], slice_of(Imf::FLOAT, sigma_[c], layout_.width));
    }
  }
  header.channels().insert("origin", Imf::Channel(Imf::HALF));
  buffer.insert("origin", slice_of(Imf::HALF, origin_, layout_.width));
  images::ExrMemoryOutput stream(origin_.size() * sizeof(half));
  {
    Imf::OutputFile file(stream, header, images::exr_threads());
    file.setFrameBuffer(buffer);
    file.writePixels(static_cast<int>(layout_.height));
  }
  return stream.take();
}

bool has_uncertainty(const Brdf& brdf, std::span<const TileIncidence> incidences) {
  std::vector<double> random(brdf.channels());
  std::vector<double> systematic(brdf.channels());
  const double side = brdf.type() == ScatterType::kBtdf ? -1 : 1;
  return std::ranges::any_of(incidences, [&](const TileIncidence& incidence) {
    const Direction omega_i = reflectance::from_spherical(incidence.theta_i, incidence.rotation);
    return brdf.uncertainty(omega_i, {-omega_i.x, -omega_i.y, side * omega_i.z}, random, systematic) ||
           brdf.uncertainty(omega_i, {0, 0, side}, random, systematic);
  });
}

Imf::Header tile_header(const TileImage::Layout& layout, const Brdf& brdf, const TileAttributes& attributes) {
  Imf::Header header(static_cast<int>(layout.width), static_cast<int>(layout.height));
  header.compression() = Imf::ZIP_COMPRESSION;
  std::vector<float> angles;
  std::vector<float> rotations;
  bool rotated = false;
  for (const TileIncidence& tile : attributes.tiles) {
    angles.push_back(static_cast<float>(reflectance::degrees(tile.theta_i)));
    rotations.push_back(static_cast<float>(reflectance::degrees(tile.rotation)));
    rotated = rotated || tile.rotation != 0;
  }
  header.insert("bsdfTileAngles", Imf::FloatVectorAttribute(angles));
  if (rotated) {
    header.insert("bsdfTileRotations", Imf::FloatVectorAttribute(rotations));
  }
  header.insert("bsdfMethod", Imf::StringAttribute(attributes.method));
  header.insert("bsdfSymmetry", Imf::StringAttribute(attributes.symmetry));
  header.insert("bsdfType", Imf::StringAttribute(brdf.type() == ScatterType::kBtdf ? "BTDF" : "BRDF"));
  header.insert("bsdfTileColumns", Imf::IntAttribute(static_cast<int>(attributes.columns)));
  header.insert("bsdfVersion", Imf::IntAttribute(kVersion));
  header.insert("bsdfWavelengths",
                Imf::FloatVectorAttribute({brdf.wavelengths_nm().begin(), brdf.wavelengths_nm().end()}));
  for (const auto& [key, value] : attributes.metadata) {
    if (!key.empty() && key.size() < kLongestKey && key.find('\0') == std::string::npos) {
      header.insert(std::string(kTileMetadataPrefix) + key, Imf::StringAttribute(value));
    }
  }
  return header;
}

}  // namespace scatter::formats
