#include "tools/plot/line_style.h"

#include <cairo.h>

#include <algorithm>

namespace scatter::plot {
namespace {

constexpr double kRow = 18;

double wavelength(const reflectance::Brdf& brdf, std::size_t channel) {
  const auto wavelengths = brdf.wavelengths_nm();
  return channel < wavelengths.size() ? double(wavelengths[channel]) : 0;
}

}  // namespace

void set_dash(const Canvas& canvas, std::size_t dash) {
  static constexpr double kPatterns[kDashes][6] = {
      {1, 0, 1, 0, 1, 0},   {6, 3, 6, 3, 6, 3},    {1.5, 2.5, 1.5, 2.5, 1.5, 2.5},
      {8, 3, 1.5, 3, 8, 3}, {12, 3, 12, 3, 12, 3}, {8, 2, 1.5, 2, 1.5, 2},
      {3, 2, 3, 2, 3, 2},   {12, 3, 3, 3, 3, 3}};
  if (dash % kDashes == 0) {
    cairo_set_dash(canvas.context(), nullptr, 0, 0);
  } else {
    cairo_set_dash(canvas.context(), kPatterns[dash % kDashes], 6, 0);
  }
}

std::string line_name(const NamedBrdf& named, std::size_t channel, bool several) {
  const std::string name = channel_name(wavelength(*named.brdf, channel), channel, named.brdf->channels());
  return several ? named.name + ": " + name : name;
}

std::vector<std::vector<LineStyle>> line_styles(std::span<const NamedBrdf> brdfs,
                                                std::span<const std::vector<std::size_t>> drawn,
                                                Theme theme) {
  std::vector<std::vector<LineStyle>> styles;
  for (std::size_t b = 0; b < brdfs.size(); ++b) {
    const reflectance::Brdf& brdf = *brdfs[b].brdf;
    std::vector<float> wavelengths;
    for (const std::size_t channel : drawn[b]) {
      if (!brdf.wavelengths_nm().empty()) {
        wavelengths.push_back(float(wavelength(brdf, channel)));
      }
    }
    const auto colours = channel_colours(wavelengths, drawn[b].size(), theme);
    auto& row = styles.emplace_back();
    for (std::size_t k = 0; k < colours.size(); ++k) {
      const bool alone = brdfs.size() == 1;
      // More BRDFs than kinds of line: thicker ones.
      row.push_back({colours[k], alone ? (colours.size() > 3 ? k % kDashes : 0) : b % kDashes,
                     1.5 + double(b / kDashes)});
    }
  }
  return styles;
}

std::vector<LineKey::Entry> line_entries(std::span<const NamedBrdf> brdfs,
                                         std::span<const std::vector<std::size_t>> drawn,
                                         std::span<const std::vector<LineStyle>> styles, const Colour& text) {
  std::vector<std::vector<std::string>> names;
  for (std::size_t b = 0; b < brdfs.size(); ++b) {
    auto& own = names.emplace_back();
    for (const std::size_t channel : drawn[b]) {
      own.push_back(line_name(brdfs[b], channel, false));
    }
  }
  std::vector<LineKey::Entry> entries;
  if (std::ranges::all_of(names, [&](const auto& own) { return own == names.front(); })) {
    for (std::size_t k = 0; k < names.front().size(); ++k) {
      LineStyle style = styles.front()[k];
      style.width = 2.5;
      entries.push_back({names.front()[k], style});
    }
    for (std::size_t b = 0; b < brdfs.size() && brdfs.size() > 1; ++b) {
      entries.push_back({brdfs[b].name, {text, styles[b].front().dash, styles[b].front().width}});
    }
    return entries;
  }
  for (std::size_t b = 0; b < brdfs.size(); ++b) {
    for (std::size_t k = 0; k < names[b].size(); ++k) {
      entries.push_back({brdfs[b].name + ": " + names[b][k], styles[b][k]});
    }
  }
  return entries;
}

LineKey::LineKey(const Canvas& canvas, std::vector<Entry> entries, double width) {
  double x = 0;
  for (Entry& entry : entries) {
    const double length = 32 + canvas.text_width(entry.words, 11, false) + 20;
    if (rows_.empty() || x + length > width) {
      rows_.emplace_back();
      starts_.emplace_back();
      x = 0;
    }
    rows_.back().push_back(std::move(entry));
    starts_.back().push_back(x);
    x += length;
  }
}

double LineKey::height() const noexcept {
  return kRow * double(rows_.size());
}

void LineKey::draw(const Canvas& canvas, double left, double y, const Colour& text) const {
  cairo_t* const c = canvas.context();
  for (std::size_t row = 0; row < rows_.size(); ++row, y += kRow) {
    for (std::size_t k = 0; k < rows_[row].size(); ++k) {
      const Entry& entry = rows_[row][k];
      const double x = left + starts_[row][k];
      Colour colour = entry.style.colour;
      canvas.set(colour);
      if (entry.kind == Entry::Kind::kDirac) {
        draw_dirac_mark(canvas, x + 13, y - 8, colour);
      } else {
        set_dash(canvas, entry.style.dash);
        cairo_set_line_width(c, entry.style.width);
        const double middle = entry.kind == Entry::Kind::kPale ? 13 : 26;
        cairo_move_to(c, x, y - 4);
        cairo_line_to(c, x + middle, y - 4);
        cairo_stroke(c);
        colour.a = kPaleOpacity;
        canvas.set(colour);
        cairo_move_to(c, x + middle, y - 4);
        cairo_line_to(c, x + 26, y - 4);
        cairo_stroke(c);
        cairo_set_dash(c, nullptr, 0, 0);
      }
      canvas.text(x + 32, y, entry.words, {.size = 11, .colour = text});
    }
  }
}

void draw_dirac_mark(const Canvas& canvas, double x, double y, const Colour& colour) {
  cairo_t* const c = canvas.context();
  canvas.set(colour);
  cairo_move_to(c, x, y);
  cairo_line_to(c, x - 4.5, y + 8);
  cairo_line_to(c, x + 4.5, y + 8);
  cairo_close_path(c);
  cairo_fill(c);
}

}  // namespace scatter::plot
