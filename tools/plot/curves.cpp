#include "tools/plot/curves.h"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>

#include "tools/plot/caption.h"
#include "tools/plot/curve_data.h"
#include "tools/plot/curve_panel.h"
#include "tools/plot/line_style.h"

namespace scatter::plot {
namespace {

using reflectance::Origin;
using reflectance::ScatterType;

constexpr std::size_t kMostChannels = 12;

Status check(std::span<const NamedBrdf> brdfs, const CurveOptions& options) {
  if (brdfs.empty() || options.incidences.empty() || options.max_panels < 1 || options.max_panels > 24) {
    return fail(ErrorCode::kInvalidArgument,
                fmt::format("{} BRDFs at {} incidences in at most {} panels, expected at least 1 of each and "
                            "at most 24 panels",
                            brdfs.size(), options.incidences.size(), options.max_panels),
                "name at least one BRDF and one incidence, and 1 to 24 panels");
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

/// What of everything asked for goes into the picture.
struct Choice {
  std::vector<Incidence> incidences;
  std::vector<std::vector<std::size_t>> channels;  ///< [brdf], those drawn.
  std::vector<std::string> told;                   ///< What was left out.
};

Choice choose(std::span<const NamedBrdf> brdfs, const CurveOptions& options) {
  Choice choice;
  const bool by_azimuth = turned(options.incidences);
  std::vector<std::string> names;
  for (const Incidence& light : options.incidences) {
    names.push_back(incidence_name(light, by_azimuth));
  }
  const auto panels = evenly_spaced(options.incidences.size(), options.max_panels);
  for (const std::size_t k : panels) {
    choice.incidences.push_back(options.incidences[k]);
  }
  choice.told.push_back(left_out("incidences", names, panels));
  for (const NamedBrdf& named : brdfs) {
    choice.channels.push_back(evenly_spaced(named.brdf->channels(), kMostChannels));
    std::vector<std::string> channels;
    for (std::size_t c = 0; c < named.brdf->channels(); ++c) {
      channels.push_back(line_name(named, c, false));
    }
    choice.told.push_back(left_out("channels of " + named.name, channels, choice.channels.back()));
  }
  std::erase(choice.told, "");
  return choice;
}

bool any_point(const std::vector<std::vector<Curve>>& panels, auto wanted) {
  return std::ranges::any_of(panels, [&](const auto& panel) {
    return std::ranges::any_of(panel,
                               [&](const Curve& curve) { return std::ranges::any_of(curve.points, wanted); });
  });
}

/// The key: lines, then what a band, a pale line and a triangle mean where the picture has them.
std::vector<LineKey::Entry> key_entries(std::span<const NamedBrdf> brdfs, const Choice& choice,
                                        std::span<const std::vector<LineStyle>> styles,
                                        const std::vector<std::vector<Curve>>& panels, bool dirac,
                                        const Palette& colours) {
  using Kind = LineKey::Entry::Kind;
  auto entries = line_entries(brdfs, choice.channels, styles, colours.text);
  if (any_point(panels, [](const Point& p) { return p.twice_uncertainty > 0; })) {
    Colour pale = colours.faint;
    pale.a = 0.3;
    entries.push_back({"±2 standard uncertainties", {pale, 0, 10}, Kind::kBand});
  }
  const bool interpolated =
      any_point(panels, [](const Point& p) { return p.origin == Origin::kInterpolated; });
  const bool extrapolated =
      any_point(panels, [](const Point& p) { return p.origin == Origin::kExtrapolated; });
  if (interpolated || extrapolated) {
    const char* const both = interpolated && extrapolated ? "pale: interpolated or extrapolated"
                             : interpolated               ? "pale: interpolated"
                                                          : "pale: extrapolated";
    entries.push_back({both, {colours.text, 0, 1.5}, Kind::kPale});
  }
  if (dirac) {
    entries.push_back({"a share of the light in this direction alone", {colours.text, 0, 1}, Kind::kDirac});
  }
  return entries;
}

}  // namespace

Result<std::string> curves(std::span<const NamedBrdf> brdfs, const CurveOptions& options,
                           std::vector<std::string>* told) {
  if (const auto checked = check(brdfs, options); !checked) {
    return std::unexpected(checked.error());
  }
  const Choice choice = choose(brdfs, options);
  const auto styles = line_styles(brdfs, choice.channels, options.theme);
  std::vector<std::vector<Curve>> panels;
  std::vector<bool> dirac;
  for (const Incidence& light : choice.incidences) {
    auto& panel = panels.emplace_back();
    dirac.push_back(false);
    for (std::size_t k = 0; k < brdfs.size(); ++k) {
      std::ranges::move(cut(*brdfs[k].brdf, k, choice.channels[k], light, options.theta_max_deg),
                        std::back_inserter(panel));
      dirac.back() = dirac.back() || !dirac_note(brdfs[k], {&light, 1}).empty();
    }
  }
  const Axis axis = value_axis(panels, options.scale);
  std::vector<std::string> sentences;
  for (const NamedBrdf& named : brdfs) {
    sentences.push_back(dirac_note(named, choice.incidences));
  }
  std::erase(sentences, "");
  std::ranges::move(unseen(panels, axis, brdfs, choice.channels), std::back_inserter(sentences));
  sentences.insert(sentences.end(), choice.told.begin(), choice.told.end());
  if (told != nullptr) {
    told->insert(told->end(), sentences.begin(), sentences.end());
  }

  constexpr double kPanelWidth = 380;
  constexpr double kPanelHeight = 240;
  constexpr double kLeft = 62;
  constexpr double kAbove = 30;
  constexpr double kBelow = 30;
  constexpr double kMargin = 18;
  const std::size_t columns = panels.size() > 1 ? 2 : 1;
  const std::size_t rows = (panels.size() + columns - 1) / columns;
  const double width = kMargin + double(columns) * (kLeft + kPanelWidth) + kMargin;
  const double text_width = width - 2 * kMargin - kLeft;
  const Palette& colours = palette(options.theme);
  const auto measure = Canvas::make(ImageKind::kPng, 1, 1, 1);  // only to know how wide words are
  if (!measure) {
    return std::unexpected(measure.error());
  }
  const bool transmitted = brdfs.front().brdf->type() == ScatterType::kBtdf;
  const std::string what[] = {
      fmt::format("{} [1/sr] in the plane of incidence over θₒ; {}", transmitted ? "BTDF" : "BRDF",
                  transmitted ? "dashed: straight through"
                              : "θₒ < 0 on the light's side; dashed: mirror direction, dotted: light")};
  const Caption heading(*measure, what, width - 2 * kMargin);
  const LineKey key(*measure,
                    key_entries(brdfs, choice, styles, panels, std::ranges::count(dirac, true) > 0, colours),
                    text_width);
  const Caption caption(*measure, sentences, text_width);

  const double head = kMargin + (options.title.empty() ? 0 : 26);
  const double top = head + heading.height();
  const double bottom = top + double(rows) * (kAbove + kPanelHeight + kBelow);
  const double height = bottom + 26 + key.height() + (sentences.empty() ? 0 : 8) + caption.height() + 14;
  auto page =
      Canvas::make(options.kind, width, height, options.kind == ImageKind::kSvg ? 1 : options.pixel_ratio);
  if (!page) {
    return std::unexpected(page.error());
  }
  page->fill_page(colours.background);
  if (!options.title.empty()) {
    page->text(kMargin, kMargin + 16, options.title, {.size = 16, .bold = true, .colour = colours.text});
  }
  heading.draw(*page, kMargin, head + 12, colours.faint);
  const bool by_azimuth = turned(options.incidences);
  for (std::size_t k = 0; k < panels.size(); ++k) {
    const Box box{kMargin + kLeft + double(k % columns) * (kLeft + kPanelWidth),
                  top + kAbove + double(k / columns) * (kAbove + kPanelHeight + kBelow), kPanelWidth,
                  kPanelHeight};
    draw_panel(*page, box, axis, options.theta_max_deg, options.theme,
               {.lines = panels[k],
                .styles = styles,
                .light = choice.incidences[k],
                .name = incidence_name(choice.incidences[k], by_azimuth),
                .type = brdfs.front().brdf->type(),
                .dirac = dirac[k]});
  }
  key.draw(*page, kMargin + kLeft, bottom + 26, colours.faint);
  caption.draw(*page, kMargin + kLeft, bottom + 26 + key.height() + 8, colours.text);
  return std::move(*page).finish();
}

}  // namespace scatter::plot
