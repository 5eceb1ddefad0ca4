#include "tools/plot/caption.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>

#include "tools/plot/ticks.h"

namespace scatter::plot {
namespace {

constexpr double kSize = 11;

}  // namespace

std::string left_out(const std::string& what, std::span<const std::string> names,
                     std::span<const std::size_t> drawn) {
  std::string missing;
  for (std::size_t k = 0; k < names.size(); ++k) {
    if (std::ranges::find(drawn, k) == drawn.end()) {
      missing += (missing.empty() ? "" : "; ") + names[k];
    }
  }
  return missing.empty()
             ? missing
             : fmt::format("{} of {} {} drawn, left out: {}", drawn.size(), names.size(), what, missing);
}

std::string dirac_note(const NamedBrdf& named, std::span<const Incidence> incidences) {
  double smallest = std::numeric_limits<double>::infinity();
  double largest = 0;
  std::vector<double> weight(named.brdf->channels());
  for (const Incidence& light : incidences) {
    std::ranges::fill(weight, 0.0);
    if (named.brdf->dirac(reflectance::from_spherical(light.theta_i, light.phi_i), weight)) {
      smallest = std::min(smallest, std::ranges::min(weight));
      largest = std::max(largest, std::ranges::max(weight));
    }
  }
  if (!(largest > 0)) {
    return {};
  }
  const std::string low = short_number(smallest);
  const std::string high = short_number(largest);
  return fmt::format(
      "{}: {} of the light leaves in the {} direction alone (Dirac share), on top of what is "
      "drawn: f has no value there",
      named.name, low == high ? high : low + " to " + high,
      named.brdf->type() == reflectance::ScatterType::kBtdf ? "straight" : "mirror");
}

Caption::Caption(const Canvas& canvas, std::span<const std::string> sentences, double width) {
  for (const std::string& sentence : sentences) {
    std::string line;
    for (std::size_t at = 0; at < sentence.size();) {
      const std::size_t end = std::min(sentence.find(' ', at), sentence.size());
      const std::string longer = line + (line.empty() ? "" : " ") + sentence.substr(at, end - at);
      if (!line.empty() && canvas.text_width(longer, kSize, false) > width) {
        lines_.push_back(line);
        line = sentence.substr(at, end - at);
      } else {
        line = longer;
      }
      at = end + 1;
    }
    lines_.push_back(line);
  }
}

void Caption::draw(const Canvas& canvas, double x, double y, const Colour& colour) const {
  for (const std::string& line : lines_) {
    canvas.text(x, y, line, {.size = kSize, .colour = colour});
    y += kLine;
  }
}

}  // namespace scatter::plot
