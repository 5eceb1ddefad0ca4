// Perceptually uniform colour map from dark violet over red to light yellow, made from a formula.
#pragma once

#include <array>
#include <cstdint>

namespace scatter::plot {

/// Colour in sRGB, components 0..1, alpha not premultiplied.
struct Colour {
  double r = 0;
  double g = 0;
  double b = 0;
  double a = 1;
};

/// Position in OKLab (Ottosson 2020): distances in it approximate perceived differences.
struct OkLab {
  double lightness = 0;  ///< 0 black .. 1 white.
  double green_red = 0;
  double blue_yellow = 0;
};

[[nodiscard]] OkLab to_oklab(const Colour& colour) noexcept;
/// The nearest colour that a screen can show: components outside the gamut are cut off.
[[nodiscard]] Colour from_oklab(const OkLab& place) noexcept;

inline constexpr std::size_t kColourMapSize = 512;

/// Table of the map, entry 0 for the smallest value.
///
/// Made once, thread-safe. The path is a curve in OKLab: lightness rises from 0.17 to 0.96, the hue
/// turns from violet (290 deg) by way of red (20 deg) to yellow (105 deg), chroma is a bump held inside
/// the sRGB gamut; the entries are then spaced equally by arc length, so that equal steps of value look
/// equally large, and values stay ordered when printed grey or seen with a colour deficiency.
[[nodiscard]] const std::array<Colour, kColourMapSize>& colour_map();

/// Colour of t, clamped to 0..1 (NaN gives entry 0).
[[nodiscard]] Colour map_colour(double t);

}  // namespace scatter::plot
