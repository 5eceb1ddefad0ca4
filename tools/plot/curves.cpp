#include "tools/plot/curves.h"

#include <cairo.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "host_sdk/reflectance/grid_brdf.h"
#include "host_sdk/reflectance/specular_grid_brdf.h"

namespace scatter::plot {
namespace {

using reflectance::Brdf;
using reflectance::degrees;
using reflectance::Direction;
using reflectance::kPi;
using reflectance::Origin;
using reflectance::radians;
using reflectance::ScatterType;

constexpr double kStepDeg = 0.5;

struct Point {
  double theta_deg = 0;
  double value = 0;
  double twice_uncertainty = 0;  ///< 0 when unknown.
  Origin origin = Origin::kInvalid;
};

/// One line of one panel.
struct Curve {
  std::size_t brdf = 0;
  std::size_t channel = 0;
  std::vector<Point> points;
};

std::vector<Curve> cut(const Brdf& brdf, std::size_t index, const Incidence& light, double theta_max_deg) {
  const std::size_t channels = brdf.channels();
  std::vector<Curve> lines(channels);
  std::vector<double> value(channels);
  std::vector<double> random(channels);
  std::vector<double> systematic(channels);
  const Direction omega_i = reflectance::from_spherical(light.theta_i, light.phi_i);
  const int steps = int(std::lround(theta_max_deg / kStepDeg));
  for (int k = -steps; k <= steps; ++k) {
    const double theta_deg = k * kStepDeg;
    Direction omega_o =
        reflectance::from_spherical(radians(std::abs(theta_deg)), light.phi_i + (theta_deg < 0 ? 0 : kPi));
    if (brdf.type() == ScatterType::kBtdf) {
      omega_o.z = -omega_o.z;
    }
    const Origin origin = brdf.eval(omega_i, omega_o, value);
    const bool known = brdf.uncertainty(omega_i, omega_o, random, systematic);
    for (std::size_t c = 0; c < channels; ++c) {
      const double u = known ? std::hypot(random[c], systematic[c]) : 0;
      const bool usable = std::isfinite(value[c]) && origin != Origin::kInvalid;
      lines[c].points.push_back({theta_deg, usable ? value[c] : 0, std::isfinite(u) ? 2 * u : 0,
                                 usable ? origin : Origin::kInvalid});
    }
  }
  for (std::size_t c = 0; c < channels; ++c) {
    lines[c].brdf = index;
    lines[c].channel = c;
  }
  return lines;
}

Axis value_axis(const std::vector<std::vector<Curve>>& panels, Scale scale) {
  double smallest = std::numeric_limits<double>::infinity();
  double largest = -smallest;
  double smallest_positive = smallest;
  std::size_t points = 0;
  std::size_t not_positive = 0;
  for (const auto& panel : panels) {
    for (const Curve& curve : panel) {
      for (const Point& point : curve.points) {
        if (point.origin != Origin::kInvalid) {
          smallest = std::min(smallest, point.value);
          largest = std::max(largest, point.value + point.twice_uncertainty);
          ++points;
          not_positive += point.value <= 0;
          smallest_positive = point.value > 0 ? std::min(smallest_positive, point.value) : smallest_positive;
        }
      }
    }
  }
  // Data cut off at 0 (colours outside the primaries' gamut, dark bins) are no reason to hide the decades of
  // the rest.
  if (scale == Scale::kAuto && 4 * not_positive < points) {
    smallest = smallest_positive;
  }
  Axis axis = choose_axis(smallest, largest, scale);
  if (axis.log) {  // room above the peak
    axis.high *= std::pow(axis.high / axis.low, 0.06);
    axis.low /= std::pow(axis.high / axis.low, 0.04);
  }
  return axis;
}

struct Box {
  double x = 0;
  double y = 0;
  double width = 0;
  double height = 0;
};

/// The kind of line of one BRDF.
void set_dash(cairo_t* c, std::size_t brdf) {
  static constexpr double kDashes[][4] = {{1, 0, 1, 0}, {6, 3, 6, 3}, {1.5, 2.5, 1.5, 2.5}, {8, 3, 1.5, 3}};
  if (brdf % 4 == 0) {
    cairo_set_dash(c, nullptr, 0, 0);
  } else {
    cairo_set_dash(c, kDashes[brdf % 4], 4, 0);
  }
}

/// Draws one panel.
class Panel {
 public:
  Panel(const Canvas& canvas, Box box, const Axis& axis, const CurveOptions& options)
      : canvas_(canvas), box_(box), axis_(axis), options_(options), colours_(palette(options.theme)) {}

  void draw(const std::vector<Curve>& lines, const Incidence& light, std::span<const NamedBrdf> brdfs) const {
    frame(light, brdfs.front().brdf->type());
    cairo_t* const c = canvas_.context();
    cairo_save(c);
    cairo_rectangle(c, box_.x, box_.y, box_.width, box_.height);
    cairo_clip(c);
    for (const Curve& line : lines) {
      band(line, colour(line, brdfs));
    }
    for (const Curve& line : lines) {
      stroke(line, colour(line, brdfs));
    }
    cairo_restore(c);
  }

 private:
  [[nodiscard]] double x(double theta_deg) const {
    return box_.x + box_.width * (0.5 + 0.5 * theta_deg / options_.theta_max_deg);
  }
  [[nodiscard]] double y(double value) const {
    return box_.y + box_.height * (1 - std::clamp(axis_.place(value), -0.5, 1.5));
  }
  [[nodiscard]] Colour colour(const Curve& line, std::span<const NamedBrdf> brdfs) const {
    const Brdf& brdf = *brdfs[line.brdf].brdf;
    const auto wavelengths = brdf.wavelengths_nm();
    return channel_colour(line.channel < wavelengths.size() ? double(wavelengths[line.channel]) : 0,
                          line.channel, brdf.channels(), options_.theme);
  }

  void rule(double x0, double y0, double x1, double y1) const {
    cairo_move_to(canvas_.context(), x0, y0);
    cairo_line_to(canvas_.context(), x1, y1);
    cairo_stroke(canvas_.context());
  }

  void frame(const Incidence& light, ScatterType type) const {
    cairo_t* const c = canvas_.context();
    for (const Tick& tick : ticks(axis_, 6)) {
      const double at = y(tick.value);
      canvas_.set(tick.label.empty() ? Colour{colours_.line.r, colours_.line.g, colours_.line.b, 0.45}
                                     : colours_.line);
      cairo_set_line_width(c, tick.label.empty() ? 0.5 : 0.8);
      rule(box_.x, at, box_.x + box_.width, at);
      canvas_.text(box_.x - 6, at + 3.5, tick.label, {.size = 10, .align = 1, .colour = colours_.faint});
    }
    for (int theta = -90; theta <= 90; theta += 15) {
      if (std::abs(theta) > options_.theta_max_deg) {
        continue;
      }
      canvas_.set(colours_.line);
      cairo_set_line_width(c, 0.8);
      rule(x(theta), box_.y, x(theta), box_.y + box_.height);
      if (theta % 30 == 0) {
        canvas_.text(x(theta), box_.y + box_.height + 14,
                     fmt::format("{}{}°", theta < 0 ? "−" : "", std::abs(theta)),
                     {.size = 10, .align = 0.5, .colour = colours_.faint});
      }
    }
    const double theta_deg = degrees(light.theta_i);
    canvas_.set(colours_.faint);
    cairo_set_line_width(c, 1);
    const double dash[] = {5, 4};
    const double dots[] = {1.5, 3};
    if (theta_deg <= options_.theta_max_deg) {
      cairo_set_dash(c, dash, 2, 0);
      rule(x(theta_deg), box_.y, x(theta_deg), box_.y + box_.height);
      if (type == ScatterType::kBrdf) {
        cairo_set_dash(c, dots, 2, 0);
        rule(x(-theta_deg), box_.y, x(-theta_deg), box_.y + box_.height);
      }
      cairo_set_dash(c, nullptr, 0, 0);
    }
    canvas_.text(box_.x, box_.y - 7, "θᵢ = " + angle_text(light.theta_i),
                 {.size = 12, .bold = true, .colour = colours_.text});
  }

  void band(const Curve& line, Colour colour) const {
    cairo_t* const c = canvas_.context();
    colour.a = options_.theme == Theme::kDark ? 0.30 : 0.22;
    const auto has_band = [](const Point& p) {
      return p.origin != Origin::kInvalid && p.twice_uncertainty > 0;
    };
    for (auto begin = line.points.begin(); begin != line.points.end();) {
      const auto first = std::find_if(begin, line.points.end(), has_band);
      const auto last = std::find_if_not(first, line.points.end(), has_band);
      for (auto p = first; p != last; ++p) {
        cairo_line_to(c, x(p->theta_deg), y(p->value + p->twice_uncertainty));
      }
      for (auto p = last; p != first;) {
        --p;
        cairo_line_to(c, x(p->theta_deg), y(p->value - p->twice_uncertainty));
      }
      if (first != last) {
        cairo_close_path(c);
        canvas_.set(colour);
        cairo_fill(c);
      }
      begin = last;
    }
  }

  void stroke(const Curve& line, Colour colour) const {
    cairo_t* const c = canvas_.context();
    cairo_set_line_width(c, 1.5);
    cairo_set_line_join(c, CAIRO_LINE_JOIN_ROUND);
    set_dash(c, line.brdf);
    const auto same = [](Origin a, Origin b) { return (a == Origin::kMeasured) == (b == Origin::kMeasured); };
    for (std::size_t k = 0; k < line.points.size();) {
      const Origin origin = line.points[k].origin;
      if (origin == Origin::kInvalid) {
        ++k;
        continue;
      }
      // A run of one kind reaches one point into the next, so that the line has no gaps.
      const std::size_t first = k > 0 && line.points[k - 1].origin != Origin::kInvalid ? k - 1 : k;
      cairo_move_to(c, x(line.points[first].theta_deg), y(line.points[first].value));
      for (; k < line.points.size() && line.points[k].origin != Origin::kInvalid &&
             same(origin, line.points[k].origin);
           ++k) {
        cairo_line_to(c, x(line.points[k].theta_deg), y(line.points[k].value));
      }
      colour.a = origin == Origin::kMeasured ? 1 : 0.42;
      canvas_.set(colour);
      cairo_stroke(c);
    }
    cairo_set_dash(c, nullptr, 0, 0);
  }

  const Canvas& canvas_;
  Box box_;
  const Axis& axis_;
  const CurveOptions& options_;
  const Palette& colours_;
};

/// Channels by colour, BRDFs by line, then what the band means.
void draw_key(const Canvas& canvas, double left, double width, double y, std::span<const NamedBrdf> brdfs,
              bool banded, Theme theme) {
  cairo_t* const c = canvas.context();
  const Palette& colours = palette(theme);
  double x = left;
  const auto entry = [&](const std::string& words, const Colour& colour, std::size_t dash, double thickness) {
    const double length = 32 + canvas.text_width(words, 11, false) + 20;
    if (x + length > left + width && x > left) {
      x = left;
      y += 18;
    }
    canvas.set(colour);
    set_dash(c, dash);
    cairo_set_line_width(c, thickness);
    cairo_move_to(c, x, y - 4);
    cairo_line_to(c, x + 26, y - 4);
    cairo_stroke(c);
    cairo_set_dash(c, nullptr, 0, 0);
    canvas.text(x + 32, y, words, {.size = 11, .colour = colours.faint});
    x += length;
  };
  const Brdf& first = *brdfs.front().brdf;
  for (std::size_t k = 0; k < first.channels() && k < 12; ++k) {
    const double wavelength = k < first.wavelengths_nm().size() ? double(first.wavelengths_nm()[k]) : 0;
    entry(channel_name(wavelength, k, first.channels()),
          channel_colour(wavelength, k, first.channels(), theme), 0, 2.5);
  }
  if (banded) {
    Colour pale = colours.faint;
    pale.a = 0.3;
    entry("±2 standard uncertainties", pale, 0, 10);
  }
  for (std::size_t k = 0; k < brdfs.size() && brdfs.size() > 1; ++k) {
    entry(brdfs[k].name, colours.text, k, 1.5);
  }
}

Status check(std::span<const NamedBrdf> brdfs, const CurveOptions& options) {
  if (brdfs.empty() || options.incidences.empty() || options.incidences.size() > 24) {
    return fail(ErrorCode::kInvalidArgument,
                fmt::format("{} BRDFs at {} incidences, expected at least 1 at 1..24", brdfs.size(),
                            options.incidences.size()),
                "name at least one BRDF and between 1 and 24 incidences");
  }
  for (const NamedBrdf& named : brdfs) {
    if (named.brdf->type() != brdfs.front().brdf->type()) {
      return fail(ErrorCode::kInvalidArgument,
                  fmt::format("'{}' and '{}' are a BRDF and a BTDF", brdfs.front().name, named.name),
                  "draw reflection and transmission in separate pictures");
    }
  }
  if (!(options.theta_max_deg >= 1 && options.theta_max_deg <= 90 && options.pixel_ratio >= 0.5 &&
        options.pixel_ratio <= 4)) {
    return fail(
        ErrorCode::kInvalidArgument,
        fmt::format("a plot to {} deg at {} pixels per unit", options.theta_max_deg, options.pixel_ratio),
        "use 1..90 deg and 0.5..4 pixels per unit");
  }
  return {};
}

}  // namespace

std::vector<Incidence> incidences_of(const Brdf& brdf) {
  std::vector<Incidence> result;
  if (const auto* grid = dynamic_cast<const reflectance::GridBrdf*>(&brdf)) {
    for (const auto& part : grid->content().parts) {
      result.push_back({part.theta_i, part.phi_i});
    }
    return result;
  }
  if (const auto* grid = dynamic_cast<const reflectance::SpecularGridBrdf*>(&brdf)) {
    for (const double theta_i : grid->content().theta_i) {
      result.push_back({theta_i, grid->content().rotation.front()});
    }
    return result;
  }
  for (const double theta_deg : {0.0, 20.0, 40.0, 60.0}) {
    result.push_back({radians(theta_deg), 0});
  }
  return result;
}

Result<std::string> curves(std::span<const NamedBrdf> brdfs, const CurveOptions& options) {
  if (const auto checked = check(brdfs, options); !checked) {
    return std::unexpected(checked.error());
  }
  std::vector<std::vector<Curve>> panels;
  bool banded = false;
  for (const Incidence& light : options.incidences) {
    auto& panel = panels.emplace_back();
    for (std::size_t k = 0; k < brdfs.size(); ++k) {
      std::ranges::move(cut(*brdfs[k].brdf, k, light, options.theta_max_deg), std::back_inserter(panel));
    }
    for (const Curve& curve : panel) {
      banded |= std::ranges::any_of(curve.points, [](const Point& p) { return p.twice_uncertainty > 0; });
    }
  }
  const Axis axis = value_axis(panels, options.scale);

  constexpr double kPanelWidth = 380;
  constexpr double kPanelHeight = 240;
  constexpr double kLeft = 62;
  constexpr double kAbove = 30;
  constexpr double kBelow = 30;
  constexpr double kMargin = 18;
  const std::size_t columns = panels.size() > 1 ? 2 : 1;
  const std::size_t rows = (panels.size() + columns - 1) / columns;
  const double head = kMargin + (options.title.empty() ? 0 : 26);
  const double width = kMargin + double(columns) * (kLeft + kPanelWidth) + kMargin;
  const double key = 66 + 18.0 * double(brdfs.size() / 2);
  const double height = head + 16 + double(rows) * (kAbove + kPanelHeight + kBelow) + key;
  auto page =
      Canvas::make(options.kind, width, height, options.kind == ImageKind::kSvg ? 1 : options.pixel_ratio);
  if (!page) {
    return std::unexpected(page.error());
  }
  const Palette& colours = palette(options.theme);
  page->fill_page(colours.background);
  if (!options.title.empty()) {
    page->text(kMargin, kMargin + 16, options.title, {.size = 16, .bold = true, .colour = colours.text});
  }
  const bool transmitted = brdfs.front().brdf->type() == ScatterType::kBtdf;
  page->text(kMargin, head + 12,
             fmt::format("{} [1/sr] in the plane of incidence over θₒ; {}", transmitted ? "BTDF" : "BRDF",
                         transmitted ? "dashed: straight through"
                                     : "θₒ < 0 on the light's side; dashed: mirror direction, dotted: light"),
             {.size = 11, .colour = colours.faint});
  for (std::size_t k = 0; k < panels.size(); ++k) {
    const Box box{kMargin + kLeft + double(k % columns) * (kLeft + kPanelWidth),
                  head + 16 + kAbove + double(k / columns) * (kAbove + kPanelHeight + kBelow), kPanelWidth,
                  kPanelHeight};
    Panel(*page, box, axis, options).draw(panels[k], options.incidences[k], brdfs);
  }
  draw_key(*page, kMargin + kLeft, width - 2 * kMargin - kLeft, height - key + 26, brdfs, banded,
           options.theme);
  return std::move(*page).finish();
}

}  // namespace scatter::plot
