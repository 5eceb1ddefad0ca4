#include "simulator/samples/textured_spec.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>

#include "simulator/samples/corroded_spec.h"
#include "simulator/samples/patina_spec.h"

namespace scatter::simulator {
namespace {

constexpr std::string_view kCorroded = "corroded:";
constexpr std::string_view kPatina = "patina:";
constexpr std::string_view kSpot = "spot=";

std::optional<double> share(std::string_view text) noexcept {
  double value = 0;
  const auto [end, problem] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (problem != std::errc{} || end != text.data() + text.size() || !(value >= 0 && value <= 1)) {
    return std::nullopt;
  }
  return value;
}

template <typename Spec, typename Sheet>
Result<std::shared_ptr<const TexturedSurface>> made(const Result<Spec>& sample, const Sheet& sheet_of) {
  if (!sample) {
    return std::unexpected(sample.error());
  }
  const auto sheet = sheet_of(*sample);
  if (!sheet) {
    return std::unexpected(sheet.error());
  }
  return std::make_shared<const TexturedSurface>(*sheet, sample->place);
}

}  // namespace

bool is_textured_spec(std::string_view spec) noexcept {
  return spec.starts_with(kCorroded) || spec.starts_with(kPatina);
}

Result<std::shared_ptr<const TexturedSurface>> make_textured_surface(std::string_view spec) {
  return spec.starts_with(kPatina) ? made(parse_patina(spec), patina_sheet)
                                   : made(parse_corroded(spec), corroded_sheet);
}

std::string spec_at(std::string_view spec, const Place& place) {
  const std::size_t colon = std::min(spec.find(':'), spec.size() - 1);
  std::string text(spec.substr(0, colon + 1));
  std::string_view rest = spec.substr(colon + 1);
  bool first = true;
  while (!rest.empty()) {
    const std::size_t comma = std::min(rest.find(','), rest.size());
    const std::string_view item = rest.substr(0, comma);
    rest.remove_prefix(std::min(comma + 1, rest.size()));
    if (!item.starts_with(kSpot)) {
      text += fmt::format("{}{}", first ? "" : ",", item);
      first = false;
    }
  }
  return fmt::format("{}{}{}{}/{}", text, first ? "" : ",", kSpot, place.u, place.v);
}

std::optional<Place> place_from(std::string_view text) noexcept {
  const std::size_t slash = text.find('/');
  if (slash == std::string_view::npos) {
    return std::nullopt;
  }
  const auto u = share(text.substr(0, slash));
  const auto v = share(text.substr(slash + 1));
  return u && v ? std::optional(Place{*u, *v}) : std::nullopt;
}

}  // namespace scatter::simulator
