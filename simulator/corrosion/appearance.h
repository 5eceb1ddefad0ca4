// What a corroded sheet looks like: colour, normals, roughness, porosity and regimes, all from one Sheet.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "host_sdk/error/error.h"
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

/// What decides on colour and regime.
enum class LookRule : std::uint8_t {
  /// The state of the cell decides: corroded is rust, however thin. Rust begins with layer 2 and is mixed by
  /// its
  /// depth in micrometres (AppearanceOptions::layer_depths_um).
  kByState,
  /// The height alone decides, as in the thesis: >= 0.99 metal, >= 0.07 rust, else hole; all four layers are
  /// mixed by
  /// the share of the thickness left (AppearanceOptions::layer_limits). Thin rust then shines like metal.
  kByHeight,
};

struct AppearanceOptions {
  LookRule rule = LookRule::kByState;
  /// From deepest rust (0) to intact metal (3). No measured table of rust could be had: the rust colours are
  /// estimates (dark, magnetite-rich; red-brown; light orange, lepidocrocite-rich), layer 3 is iron at normal
  /// incidence (Johnson and Christy 1974).
  std::array<ColourMap, 4> layers{
      ColourMap{1, 1, {Rgb{0.08F, 0.048F, 0.036F}}}, ColourMap{1, 1, {Rgb{0.20F, 0.08F, 0.038F}}},
      ColourMap{1, 1, {Rgb{0.34F, 0.13F, 0.04F}}}, ColourMap{1, 1, {Rgb{0.529F, 0.511F, 0.500F}}}};
  /// kByState: depth of lost metal [um] at which layers 0, 1 and 2 are reached, falling; mixed in proportion
  /// between. Estimates: they look right, nothing more is known.
  std::array<float, 3> layer_depths_um{700.0F, 180.0F, 5.0F};
  /// kByHeight: share of the thickness left at which layers 0 to 3 are reached, rising; mixed in proportion
  /// between.
  std::array<float, 4> layer_limits{0.0F, 1.0F / 3, 2.0F / 3, 1.0F};
  float metal_roughness = 0.15F;  ///< GGX alpha of intact metal, 0.01..1.
  /// Multiplies the height before normals are taken (a surface that was not flat to begin with), 0..1.
  Map bump{1, 1, {1.0F}};
};

/// Maps of the sheet's size, row major, first row at the top.
struct Appearance {
  std::size_t side = 0;
  std::vector<Rgb> albedo;  ///< Of the layer that shows; metal: reflectance at normal incidence.
  std::vector<Regime> regime;
  std::vector<float> metalness;  ///< 1 metal, 0 rust or hole; bilinear between cells (interpolation.h).
  std::vector<float> roughness;  ///< GGX alpha.
  std::vector<float> porosity;   ///< Of the rust, 0..1; 0 on metal.
  std::vector<float> opacity;    ///< 0 in holes, else 1.
  /// Unit normals of the height field: x to the right, y up (towards the first row), z out of the sheet.
  /// Central differences over two cells, one-sided at the border of a clamped sheet.
  std::vector<std::array<float, 3>> normal;
};

/// Errors    kInvalidArgument: names the parameter, what it is and its range.
[[nodiscard]] Status check(const AppearanceOptions& options);

/// `options` have passed check().
/// Cost      some 50 ns a cell; 48 bytes a cell.
[[nodiscard]] Appearance appearance(const Sheet& sheet, const AppearanceOptions& options = {});

/// Colour of one place: `depth_um` is used by kByState, `height` (share left) by kByHeight, `rust` (0..1,
/// share of rust against metal) mixes layer 3 in by kByState. u to the right, v down, shares of the sheet.
/// The result lies in the convex hull of the four layers' colours at (u, v).
[[nodiscard]] Rgb colour(const AppearanceOptions& options, double u, double v, float height, float depth_um,
                         float rust) noexcept;

/// GGX alpha and porosity of rust over `depth_um` of lost metal. Both are estimates without a measured
/// source: rust begins as a thin, fairly dense film and becomes rough and loose within some tenths of a
/// millimetre.
///   alpha    = 0.40 + 0.40 (1 - exp(-depth / 60 um))
///   porosity = 0.10 + 0.45 (1 - exp(-depth / 100 um))
[[nodiscard]] float rust_roughness(float depth_um) noexcept;
[[nodiscard]] float rust_porosity(float depth_um) noexcept;

/// Values of a map at (u, v), bilinear between the middles of its cells; the map repeats.
[[nodiscard]] Rgb colour_at(const ColourMap& map, double u, double v) noexcept;

}  // namespace scatter::corrosion
