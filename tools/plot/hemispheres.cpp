#include "tools/plot/hemispheres.h"

#include <cairo.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <optional>
#include <span>

#include "tools/plot/caption.h"
#include "tools/plot/disc.h"
#include "tools/plot/incidence.h"

namespace scatter::plot {
namespace {

using reflectance::GridBrdf;
using reflectance::GridPart;
using reflectance::Origin;

constexpr std::size_t kMostColumns = 12;

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

std::string row_name(const GridPart& part, bool rotated, bool by_azimuth) {
  const std::string name = incidence_name({part.theta_i, part.phi_i}, by_azimuth && !rotated);
  return rotated ? name + ", turned " + angle_text(part.rotation_rad) : name;
}

std::string column_name(const GridBrdf::Content& content, std::optional<std::size_t> channel) {
  const std::size_t k = channel.value_or(0);
  const bool merged = !channel && content.channels > 1;
  const double wavelength =
      !merged && k < content.wavelengths_nm.size() ? double(content.wavelengths_nm[k]) : 0;
  return channel_name(wavelength, k, merged ? 1 : content.channels);
}

/// One column of discs: a channel, or the mean of all.
using Column = std::optional<std::size_t>;

/// Nodes at or below 0, which a logarithmic scale draws as its smallest value; and whether there is any
/// value.
std::vector<std::string> unseen(const GridBrdf::Content& content, const std::vector<Plane>& planes,
                                const std::vector<Column>& columns, const Axis& axis) {
  std::string dark;
  std::size_t valid_anywhere = 0;
  std::size_t nodes = 0;
  for (std::size_t k = 0; k < columns.size(); ++k) {
    std::size_t valid = 0;
    std::size_t not_positive = 0;
    for (std::size_t p = k; p < planes.size(); p += columns.size()) {
      for (std::size_t n = 0; n < planes[p].size(); ++n) {
        if (planes[p].origin(n) != Origin::kInvalid && std::isfinite(planes[p].node(n))) {
          ++valid;
          not_positive += planes[p].node(n) <= 0;
        }
      }
    }
    valid_anywhere += valid;
    nodes += planes[k].size() * (planes.size() / columns.size());
    if (not_positive > 0) {
      dark += fmt::format("{}{} {} of {} directions", dark.empty() ? "" : ", ",
                          column_name(content, columns[k]), not_positive, valid);
    }
  }
  if (valid_anywhere == 0) {
    return {"nothing to draw: no direction has a value at these incidences"};
  }
  std::vector<std::string> sentences;
  if (100 * valid_anywhere < nodes) {
    sentences.push_back(fmt::format("hardly anything to draw: {} of {} directions have a value, each a point",
                                    valid_anywhere / columns.size(), nodes / columns.size()));
  }
  if (axis.log && !dark.empty()) {
    sentences.push_back(
        "a logarithmic scale cannot show values at or below 0, they have the darkest colour: " + dark);
  }
  return sentences;
}

}  // namespace

Result<std::string> hemispheres(const GridBrdf& brdf, const HemisphereOptions& options,
                                std::vector<std::string>* told) {
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
  std::vector<Column> columns;
  const auto channels = evenly_spaced(content.channels, kMostColumns);
  if (merged) {
    columns.push_back(content.channels == 1 ? Column(0) : std::nullopt);
  } else {
    columns.assign(channels.begin(), channels.end());
  }
  const auto rows = evenly_spaced(content.parts.size(), options.max_rows);
  const bool rotated =
      std::ranges::any_of(content.parts, [](const GridPart& p) { return p.rotation_rad != 0; });
  std::vector<Incidence> lights;
  for (const GridPart& part : content.parts) {
    lights.push_back({part.theta_i, part.phi_i});
  }
  const bool by_azimuth = turned(lights);

  std::vector<Plane> planes;
  for (const std::size_t row : rows) {
    for (const Column& column : columns) {
      planes.emplace_back(content, content.parts[row], column);
    }
  }
  const auto [smallest, largest] = value_range(planes);
  const Axis axis = choose_axis(smallest, largest, options.scale);

  std::vector<std::string> sentences = options.notes;
  std::ranges::move(unseen(content, planes, columns, axis), std::back_inserter(sentences));
  std::vector<std::string> names;
  for (const GridPart& part : content.parts) {
    names.push_back(row_name(part, rotated, by_azimuth));
  }
  sentences.push_back(left_out("incidences", names, rows));
  if (!merged) {
    names.clear();
    for (std::size_t k = 0; k < content.channels; ++k) {
      names.push_back(column_name(content, k));
    }
    sentences.push_back(left_out("channels", names, channels));
  }
  std::erase(sentences, "");
  if (told != nullptr) {
    told->insert(told->end(), sentences.begin(), sentences.end());
  }

  constexpr double kMargin = 28;
  constexpr double kGap = 18;
  constexpr double kRowName = 24;
  constexpr double kColumnName = 30;
  constexpr double kLegend = 104;
  // With one disc per incidence, several incidences share a line: a strip of twelve nobody looks at.
  const std::size_t abreast =
      columns.size() == 1 ? std::min<std::size_t>(4, std::size_t(std::ceil(std::sqrt(double(rows.size())))))
                          : 1;
  const std::size_t across = columns.size() * abreast;
  const std::size_t lines = (rows.size() + abreast - 1) / abreast;
  const double discs_width = double(across) * options.disc_px + double(across - 1) * kGap;
  const double width = std::max(2 * kMargin + discs_width, 640.0);
  const double head = kMargin + (options.title.empty() ? 0 : 26) + (options.subtitle.empty() ? 0 : 20);
  const double row_height = options.disc_px + kGap + kRowName;
  const auto measure = Canvas::make(ImageKind::kPng, 1, 1, 1);  // only to know how wide words are
  if (!measure) {
    return std::unexpected(measure.error());
  }
  const Caption caption(*measure, sentences, width - 2 * kMargin);
  const double discs_end = head + kColumnName + double(lines) * row_height;
  const double height = discs_end + kLegend + caption.height();

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
  const auto tints =
      channel_colours(channels.size() == content.channels ? std::span<const float>(content.wavelengths_nm)
                                                          : std::span<const float>(),
                      channels.size(), options.theme);
  for (std::size_t k = 0; k < columns.size(); ++k) {
    canvas.text(left + double(k) * (options.disc_px + kGap) + 0.5 * options.disc_px, head + 20,
                column_name(content, columns[k]),
                {.size = 13, .align = 0.5, .bold = true, .colour = merged ? colours.text : tints[k]});
  }
  for (std::size_t r = 0; r < rows.size(); ++r) {
    const double top = head + kColumnName + double(r / abreast) * row_height;
    const double start = left + double(r % abreast) * (options.disc_px + kGap);
    canvas.text(start, top + 15, row_name(content.parts[rows[r]], rotated, by_azimuth),
                {.size = 12, .bold = true, .colour = colours.text});
    for (std::size_t k = 0; k < columns.size(); ++k) {
      const Place centre{start + double(k) * (options.disc_px + kGap) + 0.5 * options.disc_px,
                         top + kRowName + 0.5 * options.disc_px};
      draw_disc(canvas, planes[r * columns.size() + k], content.parts[rows[r]], axis, centre,
                0.5 * options.disc_px, options.theme,
                options.kind == ImageKind::kSvg ? 2 : options.pixel_ratio);
      if (r == 0 && k == 0) {
        draw_ring_names(canvas, centre, 0.5 * options.disc_px);
      }
    }
  }
  const double legend_top = discs_end + 10;
  const double legend_width = std::min(width - 2 * kMargin, 620.0);
  const double legend_left = kMargin;
  const std::string unit =
      fmt::format("{} [1/sr], {} scale", content.type == reflectance::ScatterType::kBtdf ? "BTDF" : "BRDF",
                  axis.log ? "logarithmic" : "linear");
  canvas.text(legend_left, legend_top + 4, unit, {.size = 11, .colour = colours.faint});
  draw_legend(canvas, axis, {legend_left, legend_top + 12}, legend_width, colours);
  draw_key(canvas, {legend_left, legend_top + 68}, content.type == reflectance::ScatterType::kBtdf, colours);
  caption.draw(canvas, legend_left, legend_top + 92, colours.text);
  return std::move(*page).finish();
}

}  // namespace scatter::plot
