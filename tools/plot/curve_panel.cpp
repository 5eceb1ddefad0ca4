#include "tools/plot/curve_panel.h"

#include <cairo.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace scatter::plot {
namespace {

using reflectance::degrees;
using reflectance::Origin;
using reflectance::ScatterType;

/// Draws one panel.
class Panel {
 public:
  Panel(const Canvas& canvas, const Box& box, const Axis& axis, double theta_max_deg, Theme theme)
      : canvas_(canvas),
        box_(box),
        axis_(axis),
        theta_max_deg_(theta_max_deg),
        theme_(theme),
        colours_(palette(theme)) {}

  void draw(const PanelContent& content) const {
    frame(content);
    cairo_t* const c = canvas_.context();
    cairo_save(c);
    cairo_rectangle(c, box_.x, box_.y, box_.width, box_.height);
    cairo_clip(c);
    for (const Curve& line : content.lines) {
      band(line, content.styles[line.brdf][line.line].colour);
    }
    for (const Curve& line : content.lines) {
      stroke(line, content.styles[line.brdf][line.line]);
    }
    cairo_restore(c);
    say_why_empty(content);
  }

 private:
  [[nodiscard]] double x(double theta_deg) const {
    return box_.x + box_.width * (0.5 + 0.5 * theta_deg / theta_max_deg_);
  }
  [[nodiscard]] double y(double value) const {
    return box_.y + box_.height * (1 - std::clamp(axis_.place(value), -0.5, 1.5));
  }
  void rule(double x0, double y0, double x1, double y1) const {
    cairo_move_to(canvas_.context(), x0, y0);
    cairo_line_to(canvas_.context(), x1, y1);
    cairo_stroke(canvas_.context());
  }

  void frame(const PanelContent& content) const {
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
      if (std::abs(theta) > theta_max_deg_) {
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
    const double theta_deg = degrees(content.light.theta_i);
    canvas_.set(colours_.faint);
    cairo_set_line_width(c, 1);
    const double dash[] = {5, 4};
    const double dots[] = {1.5, 3};
    if (theta_deg <= theta_max_deg_) {
      cairo_set_dash(c, dash, 2, 0);
      rule(x(theta_deg), box_.y, x(theta_deg), box_.y + box_.height);
      if (content.type == ScatterType::kBrdf) {
        cairo_set_dash(c, dots, 2, 0);
        rule(x(-theta_deg), box_.y, x(-theta_deg), box_.y + box_.height);
      }
      cairo_set_dash(c, nullptr, 0, 0);
      if (content.dirac) {
        draw_dirac_mark(canvas_, x(theta_deg), box_.y, colours_.text);
      }
    }
    canvas_.text(box_.x, box_.y - 7, content.name, {.size = 12, .bold = true, .colour = colours_.text});
  }

  void band(const Curve& line, Colour colour) const {
    cairo_t* const c = canvas_.context();
    colour.a = theme_ == Theme::kDark ? 0.30 : 0.22;
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

  void stroke(const Curve& line, const LineStyle& style) const {
    cairo_t* const c = canvas_.context();
    Colour colour = style.colour;
    cairo_set_line_width(c, style.width);
    cairo_set_line_join(c, CAIRO_LINE_JOIN_ROUND);
    set_dash(canvas_, style.dash);
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
      colour.a = origin == Origin::kMeasured ? 1 : kPaleOpacity;
      canvas_.set(colour);
      cairo_stroke(c);
    }
    cairo_set_dash(c, nullptr, 0, 0);
  }

  /// An empty panel is no picture of a black surface.
  void say_why_empty(const PanelContent& content) const {
    bool any_value = false;
    for (const Curve& line : content.lines) {
      if (std::ranges::any_of(line.points, [&](const Point& p) { return shown(p, axis_); })) {
        return;
      }
      any_value |=
          std::ranges::any_of(line.points, [](const Point& p) { return p.origin != Origin::kInvalid; });
    }
    canvas_.text(box_.x + 0.5 * box_.width, box_.y + 0.45 * box_.height,
                 any_value ? "no value that a logarithmic scale can show" : "no value in this plane",
                 {.size = 12, .align = 0.5, .colour = colours_.text});
  }

  const Canvas& canvas_;
  Box box_;
  const Axis& axis_;
  double theta_max_deg_;
  Theme theme_;
  const Palette& colours_;
};

}  // namespace

void draw_panel(const Canvas& canvas, const Box& box, const Axis& axis, double theta_max_deg, Theme theme,
                const PanelContent& content) {
  Panel(canvas, box, axis, theta_max_deg, theme).draw(content);
}

}  // namespace scatter::plot
