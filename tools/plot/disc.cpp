#include "tools/plot/disc.h"

#include <cairo.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

namespace scatter::plot {

using reflectance::GridPart;
using reflectance::kPi;
using reflectance::Origin;

namespace {

constexpr double kHorizon = kPi / 2;
constexpr double kSame = 1e-9;  ///< [rad]

std::uint32_t argb(const Colour& c) {
  const auto byte = [](double v) { return std::uint32_t(std::lround(std::clamp(v, 0.0, 1.0) * 255)); };
  return 0xff000000u | byte(c.r) << 16 | byte(c.g) << 8 | byte(c.b);
}

Colour mix(const Colour& a, const Colour& b, double part) {
  return {a.r + (b.r - a.r) * part, a.g + (b.g - a.g) * part, a.b + (b.b - a.b) * part, 1};
}

/// Pixels of one disc, `size` x `size`, whole square (the caller clips to the circle).
std::vector<std::uint32_t> raster(const Plane& plane, const Axis& axis, int size, double ratio) {
  std::vector<std::uint32_t> pixels(std::size_t(size) * std::size_t(size));
  const double radius = 0.5 * size;
  const double period = 4.5 * ratio;
  for (int y = 0; y < size; ++y) {
    for (int x = 0; x < size; ++x) {
      const double right = (x + 0.5 - radius) / radius;
      const double up = (radius - y - 0.5) / radius;
      const double theta = std::hypot(right, up) * kHorizon;
      const double phi = std::atan2(up, right);
      auto sample = plane.at(std::min(theta, plane.theta_max()), phi < 0 ? phi + 2 * kPi : phi);
      // Outside the grid evaluation goes on with the last ring, which is no measurement there.
      if (theta > plane.theta_max() + kSame && sample.origin != Origin::kInvalid) {
        sample.origin = Origin::kExtrapolated;
      }
      Colour colour = kInvalidColour;
      if (sample.origin != Origin::kInvalid && std::isfinite(sample.value)) {
        colour = map_colour(axis.place(sample.value));
      }
      if (sample.origin == Origin::kInterpolated || sample.origin == Origin::kExtrapolated) {
        const double across = sample.origin == Origin::kInterpolated ? x + y : x - y + size;
        const bool line = std::fmod(across, period) < 0.34 * period;
        colour = line ? mix(colour, {1, 1, 1}, 0.6) : mix(colour, {0, 0, 0}, 0.15);
      }
      pixels[std::size_t(y) * std::size_t(size) + std::size_t(x)] = argb(colour);
    }
  }
  return pixels;
}

/// Where a direction lies in a disc around (x, y) with the horizon at `radius`.
Place on_disc(Place centre, double radius, double theta, double phi) {
  const double r = radius * theta / kHorizon;
  return {centre.x + r * std::cos(phi), centre.y - r * std::sin(phi)};
}

/// Twice: a dark halo, then the mark, so that it shows on any colour.
template <typename Path>
void outlined(const Canvas& canvas, double width, const Colour& colour, Path path) {
  cairo_t* const c = canvas.context();
  for (const bool halo : {true, false}) {
    path(c);
    canvas.set(halo ? Colour{0, 0, 0, 0.65} : colour);
    cairo_set_line_width(c, halo ? width + 2 : width);
    cairo_stroke(c);
  }
}

void draw_data(const Canvas& canvas, const Plane& plane, const Axis& axis, Place centre, double radius,
               double ratio) {
  cairo_t* const c = canvas.context();
  const int size = std::max(2, int(std::lround(2 * radius * ratio)));
  auto pixels = raster(plane, axis, size, ratio);
  cairo_surface_t* const image = cairo_image_surface_create_for_data(
      reinterpret_cast<unsigned char*>(pixels.data()), CAIRO_FORMAT_RGB24, size, size, 4 * size);
  cairo_save(c);
  cairo_arc(c, centre.x, centre.y, radius, 0, 2 * kPi);
  cairo_clip(c);
  cairo_translate(c, centre.x - radius, centre.y - radius);
  cairo_scale(c, 2 * radius / size, 2 * radius / size);
  cairo_set_source_surface(c, image, 0, 0);
  cairo_pattern_set_filter(cairo_get_source(c), CAIRO_FILTER_BILINEAR);
  cairo_paint(c);
  cairo_restore(c);
  cairo_surface_finish(image);
  cairo_surface_destroy(image);
}

void draw_polar_grid(const Canvas& canvas, Place centre, double radius, const Palette& colours) {
  cairo_t* const c = canvas.context();
  cairo_set_line_width(c, 0.8);
  for (const double ring_deg : {30.0, 60.0, 75.0}) {
    canvas.set({1, 1, 1, 0.38});
    cairo_arc(c, centre.x, centre.y, radius * ring_deg / 90, 0, 2 * kPi);
    cairo_stroke(c);
  }
  for (int k = 0; k < 12; ++k) {
    canvas.set({1, 1, 1, k % 3 == 0 ? 0.30 : 0.14});
    const Place inner = on_disc(centre, radius, kHorizon * 0.06, k * kPi / 6);
    const Place outer = on_disc(centre, radius, kHorizon * 75 / 90, k * kPi / 6);
    cairo_move_to(c, inner.x, inner.y);
    cairo_line_to(c, outer.x, outer.y);
    cairo_stroke(c);
  }
  canvas.set(colours.line);
  cairo_set_line_width(c, 1.2);
  cairo_arc(c, centre.x, centre.y, radius, 0, 2 * kPi);
  cairo_stroke(c);
}

}  // namespace

Plane::Sample Plane::at(double theta, double phi) const {
  const double y = std::min(theta / content_.theta_step, double(content_.theta_count - 1));
  const double x = phi / content_.phi_step;
  const auto j = std::min(std::size_t(y), content_.theta_count - 1);
  const auto j_next = std::min(j + 1, content_.theta_count - 1);
  const auto i = std::size_t(x) % content_.phi_count;
  const auto i_next = (i + 1) % content_.phi_count;
  const double v = y - double(j);
  const double u = x - std::floor(x);
  const std::size_t row = j * content_.phi_count;
  const std::size_t row_next = j_next * content_.phi_count;
  const std::size_t nearest = (v < 0.5 ? row : row_next) + (u < 0.5 ? i : i_next);
  const Origin origin_here = origin(nearest);
  const std::size_t corner[] = {row + i, row + i_next, row_next + i, row_next + i_next};
  const double weight[] = {(1 - u) * (1 - v), u * (1 - v), (1 - u) * v, u * v};
  double sum = 0;
  for (int k = 0; k < 4; ++k) {
    if (origin(corner[k]) == Origin::kInvalid) {
      return {node(nearest), origin_here};
    }
    sum += weight[k] * node(corner[k]);
  }
  return {sum, origin_here};
}

void mark_light(const Canvas& canvas, Place p, double size) {
  outlined(canvas, 1.4, {1, 1, 1}, [&](cairo_t* c) {
    cairo_new_sub_path(c);
    cairo_arc(c, p.x, p.y, 0.5 * size, 0, 2 * kPi);
    for (int k = 0; k < 8; ++k) {
      const double a = k * kPi / 4;
      cairo_move_to(c, p.x + 0.75 * size * std::cos(a), p.y + 0.75 * size * std::sin(a));
      cairo_line_to(c, p.x + 1.1 * size * std::cos(a), p.y + 1.1 * size * std::sin(a));
    }
  });
}

void mark_mirror(const Canvas& canvas, Place p, double size) {
  outlined(canvas, 1.4, {1, 1, 1}, [&](cairo_t* c) {
    cairo_move_to(c, p.x - size, p.y);
    cairo_line_to(c, p.x, p.y - size);
    cairo_line_to(c, p.x + size, p.y);
    cairo_line_to(c, p.x, p.y + size);
    cairo_close_path(c);
  });
}

void draw_disc(const Canvas& canvas, const Plane& plane, const GridPart& part, const Axis& axis, Place centre,
               double radius, Theme theme, double pixel_ratio) {
  draw_data(canvas, plane, axis, centre, radius, pixel_ratio);
  draw_polar_grid(canvas, centre, radius, palette(theme));
  mark_light(canvas, on_disc(centre, radius, part.theta_i, part.phi_i), radius * 0.045);
  mark_mirror(canvas, on_disc(centre, radius, part.theta_i, part.phi_i + kPi), radius * 0.055);
}

void draw_ring_names(const Canvas& canvas, Place centre, double radius) {
  for (const int ring_deg : {30, 60, 75}) {
    const Place p = on_disc(centre, radius, reflectance::radians(ring_deg), -kPi / 2);
    for (const double shift : {1.0, 0.0}) {
      canvas.text(p.x + 3 + shift, p.y - 3 + shift, fmt::format("{}°", ring_deg),
                  {.size = 10, .colour = shift > 0 ? Colour{0, 0, 0, 0.7} : Colour{1, 1, 1, 0.95}});
    }
  }
}

}  // namespace scatter::plot
