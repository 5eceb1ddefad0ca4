#include "host_sdk/reflectance/fitting/fit_family.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <optional>
#include <utility>

namespace scatter::reflectance {
namespace {

constexpr std::array<std::pair<std::string_view, FitLobe>, 5> kLobes{
    {{"ggx", FitLobe::kGgx},
     {"beckmann", FitLobe::kBeckmann},
     {"cook-torrance", FitLobe::kCookTorrance},
     {"ward", FitLobe::kWard},
     {"lafortune", FitLobe::kLafortune}}};

std::optional<FitLobe> lobe_of(std::string_view word) {
  const auto found = std::ranges::find(kLobes, word, &std::pair<std::string_view, FitLobe>::first);
  return found == kLobes.end() ? std::nullopt : std::optional(found->second);
}

std::string_view word_of(FitLobe lobe) {
  return std::ranges::find(kLobes, lobe, &std::pair<std::string_view, FitLobe>::second)->first;
}

std::unexpected<Error> bad(std::string_view name, const std::string& why) {
  return fail(ErrorCode::kInvalidArgument, fmt::format("model family '{}': {}", name, why),
              "use lambert, oren-nayar, disney, gltf, metallic-roughness, or one or two of ggx, beckmann, "
              "cook-torrance, ward, "
              "lafortune, joined by +, for example oren-nayar+ggx or ggx2");
}

}  // namespace

Result<FitFamily> fit_family(std::string_view name) {
  if (name == "disney") {
    return FitFamily{.whole = FitWhole::kDisney};
  }
  if (name == "gltf") {
    return FitFamily{.whole = FitWhole::kGltf};
  }
  if (name == "metallic-roughness") {
    return FitFamily{.whole = FitWhole::kMetallicRoughness};
  }
  FitFamily family;
  std::string_view rest = name;
  for (bool first = true; first || !rest.empty(); first = false) {
    const std::size_t plus = rest.find('+');
    std::string_view word = rest.substr(0, plus);
    if (plus != std::string_view::npos && plus + 1 == rest.size()) {
      return bad(name, "nothing behind the last +");
    }
    rest = plus == std::string_view::npos ? std::string_view{} : rest.substr(plus + 1);
    if (word == "lambert" || word == "oren-nayar") {
      if (!first) {
        return bad(name, fmt::format("the base '{}' stands behind something", word));
      }
      family.base = word == "lambert" ? FitBase::kLambert : FitBase::kOrenNayar;
      continue;
    }
    const bool twice = word.ends_with('2');
    if (twice) {
      word.remove_suffix(1);
    }
    const auto lobe = lobe_of(word);
    if (!lobe) {
      return bad(name, fmt::format("there is no base or lobe '{}'", word));
    }
    family.lobes.insert(family.lobes.end(), twice ? 2 : 1, *lobe);
  }
  if (family.lobes.size() > 2) {
    return bad(name, fmt::format("{} lobes, at most 2 can be told apart", family.lobes.size()));
  }
  return family;
}

std::string name(const FitFamily& family) {
  switch (family.whole) {
    case FitWhole::kNone:
      break;
    case FitWhole::kDisney:
      return "disney";
    case FitWhole::kGltf:
      return "gltf";
    case FitWhole::kMetallicRoughness:
      return "metallic-roughness";
  }
  std::string text;
  const bool lambert = family.base == FitBase::kLambert;
  if (!lambert || family.lobes.empty()) {
    text = lambert ? "lambert" : "oren-nayar";
  }
  for (std::size_t k = 0; k < family.lobes.size(); ++k) {
    if (k == 1 && family.lobes[0] == family.lobes[1]) {
      text += '2';
      break;
    }
    text += text.empty() ? "" : "+";
    text += word_of(family.lobes[k]);
  }
  return text;
}

std::vector<FitFamily> default_families() {
  std::vector<FitFamily> families;
  for (const char* text : {"lambert", "oren-nayar", "lafortune", "ward", "ggx", "beckmann",
                           "oren-nayar+lafortune", "oren-nayar+ward", "oren-nayar+ggx", "oren-nayar+beckmann",
                           "cook-torrance", "disney", "ward2", "ggx2", "beckmann2"}) {
    families.push_back(*fit_family(text));
  }
  return families;
}

}  // namespace scatter::reflectance
