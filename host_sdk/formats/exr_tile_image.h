// The image behind EXR tiles and atlases, on its way into a file. Internal to formats: includes
// OpenEXR.
#pragma once

#include <Imath/half.h>
#include <OpenEXR/ImfHeader.h>

#include <cstddef>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "host_sdk/formats/exr_tile_layout.h"
#include "host_sdk/reflectance/brdf.h"

namespace scatter::formats {

/// Channels R, G, B or Y, optionally sigma of each, and origin; all 0 at first.
class TileImage {
 public:
  struct Layout {
    std::size_t width = 0;   ///< Of the image.
    std::size_t height = 0;  ///< Likewise.
    std::size_t tile_width = 0;
    std::size_t tile_height = 0;
    std::size_t channels = 3;    ///< 1 or 3.
    bool half_precision = true;  ///< Of the values; sigma is always float.
    bool sigma = false;
  };
  /// One tile to fill.
  struct Tile {
    const reflectance::Brdf* brdf = nullptr;  ///< As many channels as the image.
    TileIncidence incidence;
    std::size_t left = 0;
    std::size_t top = 0;
  };

  explicit TileImage(const Layout& layout);

  /// Evaluates the tiles at the centres of their texels, on all cores.
  void fill(std::span<const Tile> tiles);
  /// File image with these attributes; the channels are added here. ZIP, on all cores.
  /// Throws  what OpenEXR throws.
  [[nodiscard]] std::string encode(Imf::Header header) const;

 private:
  void fill_rows(const Tile& tile, std::size_t first, std::size_t last);

  Layout layout_;
  std::vector<std::vector<half>> half_;
  std::vector<std::vector<float>> float_;
  std::vector<std::vector<float>> sigma_;
  std::vector<half> origin_;
  std::vector<double> cos_azimuth_;  ///< Of the texels of a row.
  std::vector<double> sin_azimuth_;
};

/// Whether the BRDF states uncertainties, asked in the mirror direction and at the normal.
[[nodiscard]] bool has_uncertainty(const reflectance::Brdf& brdf, std::span<const TileIncidence> incidences);

/// Attributes that all tile images have.
struct TileAttributes {
  std::span<const TileIncidence> tiles;
  std::size_t columns = 1;
  std::string method;
  std::string symmetry;
  std::map<std::string, std::string> metadata;
};
/// Of an image of this size; type and wavelengths are those of `brdf`.
[[nodiscard]] Imf::Header tile_header(const TileImage::Layout& layout, const reflectance::Brdf& brdf,
                                      const TileAttributes& attributes);

}  // namespace scatter::formats
