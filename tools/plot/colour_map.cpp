#include "tools/plot/colour_map.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

namespace scatter::plot {
namespace {

double to_linear(double v) {
  return v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4);
}
double to_encoded(double v) {
  return v <= 0.0031308 ? 12.92 * v : 1.055 * std::pow(v, 1 / 2.4) - 0.055;
}

/// Linear sRGB of an OKLab colour; components leave 0..1 outside the gamut. Matrices: Ottosson 2020.
std::array<double, 3> to_linear_rgb(const OkLab& c) {
  const double l = std::pow(c.lightness + 0.3963377774 * c.green_red + 0.2158037573 * c.blue_yellow, 3);
  const double m = std::pow(c.lightness - 0.1055613458 * c.green_red - 0.0638541728 * c.blue_yellow, 3);
  const double s = std::pow(c.lightness - 0.0894841775 * c.green_red - 1.2914855480 * c.blue_yellow, 3);
  return {4.0767416621 * l - 3.3077115913 * m + 0.2309699292 * s,
          -1.2684380046 * l + 2.6097574011 * m - 0.3413193965 * s,
          -0.0041960863 * l - 0.7034186147 * m + 1.7076147010 * s};
}

bool in_gamut(const OkLab& c) {
  const auto rgb = to_linear_rgb(c);
  return std::ranges::all_of(rgb, [](double v) { return v >= 0 && v <= 1; });
}

OkLab at_chroma(double lightness, double hue, double chroma) {
  return {lightness, chroma * std::cos(hue), chroma * std::sin(hue)};
}

/// The curve before it is spaced by arc length.
OkLab path(double t) {
  const double lightness = 0.17 + 0.79 * t;
  const double hue = (290.0 + 175.0 * t) * std::numbers::pi / 180;
  // Full chroma in the middle, little at the ends, where the gamut is narrow.
  const double wanted = 0.05 + 0.145 * std::pow(std::sin(std::numbers::pi * std::pow(t, 0.85)), 0.8);
  // 2 % inside the gamut's wall, by bisection.
  double low = 0;
  double high = 0.4;
  for (int i = 0; i < 40; ++i) {
    const double middle = 0.5 * (low + high);
    (in_gamut(at_chroma(lightness, hue, middle)) ? low : high) = middle;
  }
  // A smooth minimum: a kink in the chroma would show as a false edge.
  const double wall = 0.98 * low;
  const double softness = 0.012;
  const double blend = std::clamp(0.5 + 0.5 * (wall - wanted) / softness, 0.0, 1.0);
  const double chroma = wall + (wanted - wall) * blend - softness * blend * (1 - blend);
  return at_chroma(lightness, hue, std::max(0.0, chroma));
}

double distance(const OkLab& a, const OkLab& b) {
  return std::hypot(a.lightness - b.lightness, a.green_red - b.green_red, a.blue_yellow - b.blue_yellow);
}

std::array<Colour, kColourMapSize> make_map() {
  constexpr std::size_t kFine = 16384;
  std::vector<double> length(kFine + 1, 0.0);
  OkLab before = path(0);
  for (std::size_t i = 1; i <= kFine; ++i) {
    const OkLab here = path(double(i) / kFine);
    length[i] = length[i - 1] + distance(before, here);
    before = here;
  }
  std::array<Colour, kColourMapSize> table;
  for (std::size_t k = 0; k < kColourMapSize; ++k) {
    const double wanted = length.back() * double(k) / double(kColourMapSize - 1);
    const auto upper = std::ranges::lower_bound(length, wanted);
    const auto i = std::size_t(std::clamp<std::ptrdiff_t>(upper - length.begin(), 1, kFine));
    const double part = (wanted - length[i - 1]) / (length[i] - length[i - 1]);
    table[k] = from_oklab(path((double(i - 1) + part) / kFine));
  }
  return table;
}

}  // namespace

OkLab to_oklab(const Colour& colour) noexcept {
  const double r = to_linear(colour.r);
  const double g = to_linear(colour.g);
  const double b = to_linear(colour.b);
  const double l = std::cbrt(0.4122214708 * r + 0.5363325363 * g + 0.0514459929 * b);
  const double m = std::cbrt(0.2119034982 * r + 0.6806995451 * g + 0.1073969566 * b);
  const double s = std::cbrt(0.0883024619 * r + 0.2817188376 * g + 0.6299787005 * b);
  return {0.2104542553 * l + 0.7936177850 * m - 0.0040720468 * s,
          1.9779984951 * l - 2.4285922050 * m + 0.4505937099 * s,
          0.0259040371 * l + 0.7827717662 * m - 0.8086757660 * s};
}

Colour from_oklab(const OkLab& place) noexcept {
  const auto rgb = to_linear_rgb(place);
  return {to_encoded(std::clamp(rgb[0], 0.0, 1.0)), to_encoded(std::clamp(rgb[1], 0.0, 1.0)),
          to_encoded(std::clamp(rgb[2], 0.0, 1.0)), 1};
}

const std::array<Colour, kColourMapSize>& colour_map() {
  static const std::array<Colour, kColourMapSize> kTable = make_map();
  return kTable;
}

Colour map_colour(double t) {
  const double place = (t > 0 ? std::min(t, 1.0) : 0.0) * double(kColourMapSize - 1);
  return colour_map()[std::size_t(std::lround(place))];
}

}  // namespace scatter::plot
