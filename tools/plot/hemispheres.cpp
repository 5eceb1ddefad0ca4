#include "tools/plot/hemispheres.h"

#include <cairo.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>

namespace scatter::plot {
namespace {

using reflectance::GridBrdf;
using reflectance::GridPart;
using reflectance::kPi;
using reflectance::Origin;

constexpr double kHorizon = kPi / 2;
constexpr Colour kInvalidColour{0.27, 0.28, 0.30, 1};

/// One disc's data: a plane of values or the mean of all planes.
class Plane {
 public:
  Plane(const GridBrdf::Content& content, const GridPart& part, std::optional<std::size_t> channel)
      : content_(content), part_(part), channel_(channel) {}

  [[nodiscard]] double node(std::size_t index) const {
    if (channel_) {
      return part_.f_per_sr[*channel_][index];
    }
    double sum = 0;
    for (const auto& plane : part_.f_per_sr) {
      sum += plane[index];
    }
    return sum / double(part_.f_per_sr.size());
  }
  [[nodiscard]] Origin origin(std::size_t index) const { return part_.origin[index]; }
  [[nodiscard]] std::size_t size() const { return part_.origin.size(); }
  [[nodiscard]] double theta_max() const { return double(content_.theta_count - 1) * content_.theta_step; }

  struct Sample {
    double value = 0;
    Origin origin = Origin::kInvalid;
  };
  /// Bilinear; next to an invalid node, and on a ring without a neighbour, the nearest node.
  [[nodiscard]] Sample at(double theta, double phi) const {
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

 private:
  const GridBrdf::Content& content_;
  const GridPart& part_;
  std::optional<std::size_t> channel_;
};

std::uint32_t argb(const Colour& c) {
  const auto byte = [](double v) { return std::uint32_t(std::lround(std::clamp(v, 0.0, 1.0) * 255)); };
  return 0xff000000u | byte(c.r) << 16 | byte(c.g) << 8 | byte(c.b);
}

Colour mix(const Colour& a, const Colour& b, double part) {
  return {a.r + (b.r - a.r) * part, a.g + (b.g - a.g) * part, a.b + (b.b - a.b) * part, 1};
}

/// The smallest and largest value worth a colour.
std::pair<double, double> value_range(const std::vector<Plane>& planes) {
  for (const bool measured_only : {true, false}) {
    std::vector<double> values;
    for (const Plane& plane : planes) {
      for (std::size_t k = 0; k < plane.size(); ++k) {
        const Origin origin = plane.origin(k);
        const double value = plane.node(k);
        if ((measured_only ? origin == Origin::kMeasured : origin != Origin::kInvalid) &&
            std::isfinite(value)) {
          values.push_back(value);
        }
      }
    }
    if (values.empty()) {
      continue;
    }
    const auto low = values.begin() + std::ptrdiff_t(double(values.size() - 1) * 0.002);
    std::ranges::nth_element(values, low);
    return {*low, *std::ranges::max_element(values)};
  }
  return {0, 1};
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
      const double theta = std::min(std::hypot(right, up) * kHorizon, plane.theta_max());
      const double phi = std::atan2(up, right);
      const auto sample = plane.at(theta, phi < 0 ? phi + 2 * kPi : phi);
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

struct Place {
  double x = 0;
  double y = 0;
};

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

void draw_data(const Canvas& canvas, const Plane& plane, const Axis& axis, Place centre, double radius,
               double ratio) {
  cairo_t* const c = canvas.context();
  const int size = std::max(2, int(std::lround(2 * radius * ratio)));
  auto pixels = raster(plane, axis, size, ratio);
  cairo_surface_t* const image = cairo_image_surface_create_for_data(
      reinterpret_cast<unsigned char*>(pixels.data()), CAIRO_FORMAT_RGB24, size, size, 4 * size);
  cairo_save(c);
  cairo_arc(c, centre.x, centre.y, radius * std::min(1.0, plane.theta_max() / kHorizon), 0, 2 * kPi);
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

void draw_disc(const Canvas& canvas, const Plane& plane, const GridPart& part, const Axis& axis, Place centre,
               double radius, const HemisphereOptions& options) {
  draw_data(canvas, plane, axis, centre, radius, options.kind == ImageKind::kSvg ? 2 : options.pixel_ratio);
  draw_polar_grid(canvas, centre, radius, palette(options.theme));
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

void draw_legend(const Canvas& canvas, const Axis& axis, Place corner, double width, const Palette& colours) {
  cairo_t* const c = canvas.context();
  constexpr double kHeight = 14;
  cairo_pattern_t* const ramp = cairo_pattern_create_linear(corner.x, 0, corner.x + width, 0);
  for (int k = 0; k <= 64; ++k) {
    const Colour colour = map_colour(k / 64.0);
    cairo_pattern_add_color_stop_rgb(ramp, k / 64.0, colour.r, colour.g, colour.b);
  }
  cairo_set_source(c, ramp);
  cairo_rectangle(c, corner.x, corner.y, width, kHeight);
  cairo_fill(c);
  cairo_pattern_destroy(ramp);
  cairo_set_line_width(c, 1);
  double free_from = -1e9;
  for (const Tick& tick : ticks(axis, int(width / 90))) {
    const double x = corner.x + width * axis.place(tick.value);
    canvas.set(colours.faint);
    cairo_move_to(c, x, corner.y + kHeight);
    cairo_line_to(c, x, corner.y + kHeight + (tick.label.empty() ? 3 : 6));
    cairo_stroke(c);
    const double half = 0.5 * canvas.text_width(tick.label, 11, false);
    if (!tick.label.empty() && x - half > free_from) {
      canvas.text(x, corner.y + kHeight + 19, tick.label, {.size = 11, .align = 0.5, .colour = colours.text});
      free_from = x + half + 6;
    }
  }
}

/// What the marks and hatchings mean, one line under the legend.
void draw_key(const Canvas& canvas, Place corner, bool transmitted, const Palette& colours) {
  cairo_t* const c = canvas.context();
  double x = corner.x;
  const auto words = [&](const std::string& text) {
    canvas.text(x, corner.y + 4, text, {.size = 11, .colour = colours.faint});
    x += canvas.text_width(text, 11, false) + 22;
  };
  mark_light(canvas, {x + 7, corner.y}, 6);
  x += 20;
  words(transmitted ? "light (from below)" : "light");
  mark_mirror(canvas, {x + 7, corner.y}, 6);
  x += 20;
  words(transmitted ? "straight through" : "mirror direction");
  for (const int kind : {0, 1, 2}) {
    cairo_save(c);
    cairo_rectangle(c, x, corner.y - 6, 18, 12);
    cairo_clip(c);
    canvas.set(kind == 2 ? kInvalidColour : map_colour(0.45));
    cairo_paint(c);
    canvas.set({1, 1, 1, 0.6});
    cairo_set_line_width(c, 1.2);
    for (int k = -4; k < 6 && kind < 2; ++k) {
      cairo_move_to(c, x + k * 4.5, corner.y + (kind == 0 ? 6 : -6));
      cairo_line_to(c, x + k * 4.5 + 12, corner.y + (kind == 0 ? -6 : 6));
      cairo_stroke(c);
    }
    cairo_restore(c);
    x += 24;
    words(kind == 0 ? "interpolated" : kind == 1 ? "extrapolated" : "no value");
  }
}

std::vector<std::size_t> rows_to_show(std::size_t count, std::size_t limit) {
  std::vector<std::size_t> rows;
  const std::size_t shown = std::min(count, std::max<std::size_t>(1, limit));
  for (std::size_t k = 0; k < shown; ++k) {
    rows.push_back(shown == 1 ? 0 : k * (count - 1) / (shown - 1));
  }
  return rows;
}

std::string row_name(const GridPart& part, bool rotated) {
  const std::string name = "θᵢ = " + angle_text(part.theta_i);
  return rotated ? name + ", turned " + angle_text(part.rotation_rad) : name;
}

}  // namespace

Result<std::string> hemispheres(const GridBrdf& brdf, const HemisphereOptions& options) {
  const GridBrdf::Content& content = brdf.content();
  if (content.parts.empty()) {
    return fail(ErrorCode::kInvalidArgument, "this BRDF has no incidence to draw",
                "measure at least one illumination");
  }
  if (!(options.disc_px >= 48 && options.disc_px <= 2000 && options.pixel_ratio >= 0.5 &&
        options.pixel_ratio <= 4)) {
    return fail(ErrorCode::kInvalidArgument,
                fmt::format("discs of {} px at {} px per unit", options.disc_px, options.pixel_ratio),
                "use discs of 48..2000 px at 0.5..4 pixels per unit");
  }
  const bool merged = options.luminance || content.channels == 1;
  const std::size_t columns = merged ? 1 : content.channels;
  const auto rows = rows_to_show(content.parts.size(), options.max_rows);
  const bool rotated =
      std::ranges::any_of(content.parts, [](const GridPart& p) { return p.rotation_rad != 0; });

  std::vector<Plane> planes;
  for (const std::size_t row : rows) {
    for (std::size_t k = 0; k < columns; ++k) {
      planes.emplace_back(content, content.parts[row], merged ? std::nullopt : std::optional(k));
    }
  }
  const auto [smallest, largest] = value_range(planes);
  const Axis axis = choose_axis(smallest, largest, options.scale);

  constexpr double kMargin = 28;
  constexpr double kGap = 18;
  constexpr double kRowName = 24;
  constexpr double kColumnName = 30;
  constexpr double kLegend = 104;
  // With one disc per incidence, several incidences share a line: a strip of twelve nobody looks at.
  const std::size_t abreast =
      columns == 1 ? std::min<std::size_t>(4, std::size_t(std::ceil(std::sqrt(double(rows.size()))))) : 1;
  const std::size_t across = columns * abreast;
  const std::size_t lines = (rows.size() + abreast - 1) / abreast;
  const double discs_width = double(across) * options.disc_px + double(across - 1) * kGap;
  const double width = std::max(2 * kMargin + discs_width, 640.0);
  const double head = kMargin + (options.title.empty() ? 0 : 26) + (options.subtitle.empty() ? 0 : 20);
  const double row_height = options.disc_px + kGap + kRowName;
  const double height = head + kColumnName + double(lines) * row_height + kLegend;

  auto page =
      Canvas::make(options.kind, width, height, options.kind == ImageKind::kSvg ? 1 : options.pixel_ratio);
  if (!page) {
    return std::unexpected(page.error());
  }
  const Canvas& canvas = *page;
  const Palette& colours = palette(options.theme);
  canvas.fill_page(colours.background);
  if (!options.title.empty()) {
    canvas.text(kMargin, kMargin + 16, options.title, {.size = 19, .bold = true, .colour = colours.text});
  }
  if (!options.subtitle.empty()) {
    canvas.text(kMargin, head - 6, options.subtitle, {.size = 12, .colour = colours.faint});
  }
  const double left = 0.5 * (width - discs_width);
  for (std::size_t k = 0; k < columns; ++k) {
    const double wavelength = !merged && k < content.wavelengths_nm.size() ? double(content.wavelengths_nm[k])
                              : content.channels == 1 && !content.wavelengths_nm.empty()
                                  ? double(content.wavelengths_nm[0])
                                  : 0;
    canvas.text(
        left + double(k) * (options.disc_px + kGap) + 0.5 * options.disc_px, head + 20,
        channel_name(wavelength, k, merged ? 1 : content.channels),
        {.size = 13,
         .align = 0.5,
         .bold = true,
         .colour = merged ? colours.text : channel_colour(wavelength, k, content.channels, options.theme)});
  }
  for (std::size_t r = 0; r < rows.size(); ++r) {
    const double top = head + kColumnName + double(r / abreast) * row_height;
    const double start = left + double(r % abreast) * (options.disc_px + kGap);
    canvas.text(start, top + 15, row_name(content.parts[rows[r]], rotated),
                {.size = 12, .bold = true, .colour = colours.text});
    for (std::size_t k = 0; k < columns; ++k) {
      const Place centre{start + double(k) * (options.disc_px + kGap) + 0.5 * options.disc_px,
                         top + kRowName + 0.5 * options.disc_px};
      draw_disc(canvas, planes[r * columns + k], content.parts[rows[r]], axis, centre, 0.5 * options.disc_px,
                options);
      if (r == 0 && k == 0) {
        draw_ring_names(canvas, centre, 0.5 * options.disc_px);
      }
    }
  }
  const double legend_top = height - kLegend + 10;
  const double legend_width = std::min(width - 2 * kMargin, 620.0);
  const double legend_left = kMargin;
  std::string unit =
      fmt::format("{} [1/sr], {} scale", content.type == reflectance::ScatterType::kBtdf ? "BTDF" : "BRDF",
                  axis.log ? "logarithmic" : "linear");
  if (rows.size() < content.parts.size()) {
    unit += fmt::format("; {} of {} incidences shown", rows.size(), content.parts.size());
  }
  canvas.text(legend_left, legend_top + 4, unit, {.size = 11, .colour = colours.faint});
  draw_legend(canvas, axis, {legend_left, legend_top + 12}, legend_width, colours);
  draw_key(canvas, {legend_left, legend_top + 68}, content.type == reflectance::ScatterType::kBtdf, colours);
  return std::move(*page).finish();
}

}  // namespace scatter::plot
