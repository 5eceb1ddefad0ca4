// What a corroded sheet looks like: colour, normals, roughness, porosity and regimes, all from one Sheet.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "simulator/corrosion/map.h"
#include "simulator/corrosion/sheet.h"

namespace scatter::corrosion {

/// Linear RGB reflectance, 0..1, for 630, 525, 465 nm.
using Rgb = std::array<float, 3>;

/// A colour over the whole sheet, laid out as Map; one value is a constant.
struct ColourMap {
  std::size_t width = 1;
  std::size_t height = 1;
  std::vector<Rgb> values{Rgb{0, 0, 0}};
};

/// Which material a place scatters as.
enum class Regime : std::uint8_t { kMetal = 0, kRust = 1, kHole = 2 };

struct AppearanceOptions {
  /// From deepest rust (0) to intact metal (3). No measured table of rust could be had: the rust colours are
  /// estimates (corrosion.md 5.2), layer 3 is iron at normal incidence (Johnson and Christy 1974).
  std::array<ColourMap, 4> layers{ColourMap{1, 1, {Rgb{0.08F, 0.05F, 0.04F}}},
                                  ColourMap{1, 1, {Rgb{0.20F, 0.09F, 0.05F}}},
                                  ColourMap{1, 1, {Rgb{0.30F, 0.13F, 0.05F}}},
                                  ColourMap{1, 1, {Rgb{0.529F, 0.511F, 0.500F}}}};
  /// Share of the thickness left at which each layer's colour is reached, falling from layer 3 to layer 0;
  /// between two limits colours are mixed in proportion. Rust never shows layer 3: it starts at layer 2.
  std::array<float, 4> limits{0.0F, 1.0F / 3, 2.0F / 3, 1.0F};
  float metal_roughness = 0.15F;  ///< GGX alpha of intact metal, 0.01..1.
};

/// Maps of the sheet's size, row major, first row at the top.
struct Appearance {
  std::size_t side = 0;
  std::vector<Rgb> albedo;        ///< Of the layer that shows; metal: reflectance at normal incidence.
  std::vector<Regime> regime;
  std::vector<float> metalness;   ///< 1 metal, 0 rust, bilinear over the border between them.
  std::vector<float> roughness;   ///< GGX alpha.
  std::vector<float> porosity;    ///< Of the rust, 0..1; 0 on metal.
  std::vector<float> opacity;     ///< 0 in holes.
  /// Unit normals of the height field: x to the right, y up (towards the first row), z out of the sheet.
  std::vector<std::array<float, 3>> normal;
};

[[nodiscard]] Appearance appearance(const Sheet& sheet, const AppearanceOptions& options = {});

}  // namespace scatter::corrosion
