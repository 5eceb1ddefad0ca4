// What a MiniDiff file holds, before it is a grid. Internal to the reader.
#pragma once

#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "host_sdk/error/error.h"
#include "host_sdk/formats/even_grid.h"
#include "host_sdk/formats/reader_warnings.h"
#include "host_sdk/reflectance/grid_brdf.h"

namespace scatter::formats {

struct MiniDiffContent {
  /// Values of one incidence, in the order in which channels came: the same for every incidence.
  struct Incidence {
    double aoi_deg = 0;
    double poi_deg = 0;
    /// Wavelengths [nm], or 0 1 2 for tristimulus X Y Z: what tells the channels apart.
    std::vector<double> keys;
    std::vector<std::size_t> places;  ///< TextScanner::place() of each channel's block.
    std::vector<double> totals;
    std::vector<std::vector<float>> planes;  ///< [radial * phi_deg.size() + azimuth]
  };
  reflectance::ScatterType type = reflectance::ScatterType::kBrdf;
  bool plane_symmetric = false;
  bool tristimulus = false;
  std::vector<double> radial_deg;
  std::vector<double> phi_deg;  ///< Of the planes' columns: without 360, mirror images included.
  EvenLayout layout;
  std::vector<Incidence> incidences;
  std::map<std::string, std::string> metadata;
  ReaderWarnings warnings;
  std::vector<std::string_view> comments;  ///< As TextScanner::comments().
};

/// `content` has incidences. Errors  kDataLoss, kUnimplemented: without the file's name.
[[nodiscard]] Result<reflectance::GridBrdf> grid_of(MiniDiffContent content);

}  // namespace scatter::formats
