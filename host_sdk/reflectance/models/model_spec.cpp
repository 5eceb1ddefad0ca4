#include "host_sdk/reflectance/models/model_spec.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include "host_sdk/reflectance/models/film.h"
#include "host_sdk/reflectance/models/ggx.h"
#include "host_sdk/reflectance/models/lambert.h"

namespace scatter::reflectance {
namespace {

constexpr std::string_view kRemedy =
    "use lambertian:ALBEDO, ggx:alpha=A,f0=F,albedo=R or film:transmittance=T,haze=H, each value one "
    "number or red/green/blue";

/// One key of a model: its range and, when it may be left out, its default.
struct Key {
  std::string_view name;
  double lowest;
  double highest;
  std::optional<double> otherwise;
};

struct Model {
  std::string_view name;
  std::vector<Key> keys;
  std::shared_ptr<const Brdf> (*make)(const std::vector<ChannelValues>& values);
};

const std::vector<Model>& models() {
  static const std::vector<Model> kModels{
      {"lambertian",
       {{"albedo", 0, 1, std::nullopt}},
       [](const std::vector<ChannelValues>& v) -> std::shared_ptr<const Brdf> {
         return std::make_shared<Lambert>(v[0]);
       }},
      {"ggx",
       {{"alpha", 0.001, 1, std::nullopt}, {"f0", 0, 1, 0.04}, {"albedo", 0, 1, 0.0}},
       [](const std::vector<ChannelValues>& v) -> std::shared_ptr<const Brdf> {
         return std::make_shared<Ggx>(Ggx::Parameters{.alpha = v[0], .f0 = v[1], .albedo = v[2]});
       }},
      {"film",
       {{"transmittance", 0, 1, std::nullopt}, {"haze", 0, 1, std::nullopt}},
       [](const std::vector<ChannelValues>& v) -> std::shared_ptr<const Brdf> {
         return std::make_shared<Film>(Film::Parameters{.transmittance = v[0], .haze = v[1]});
       }}};
  return kModels;
}

std::unexpected<Error> bad(std::string_view spec, const std::string& what) {
  return fail(ErrorCode::kInvalidArgument, fmt::format("model '{}': {}", spec, what), std::string(kRemedy));
}

/// Cuts and returns the text before the first separator.
std::string_view take(std::string_view& text, char separator) {
  const std::size_t at = std::min(text.find(separator), text.size());
  const std::string_view head = text.substr(0, at);
  text.remove_prefix(std::min(at + 1, text.size()));
  return head;
}

std::optional<ChannelValues> parse_values(std::string_view text, const Key& key) {
  ChannelValues values{};
  std::size_t count = 0;
  while (true) {
    const bool more = text.find('/') != std::string_view::npos;
    const std::string_view number = take(text, '/');
    double value = 0;
    const auto [end, error] = std::from_chars(number.data(), number.data() + number.size(), value);
    if (error != std::errc{} || end != number.data() + number.size() || count == values.size() ||
        !(value >= key.lowest && value <= key.highest)) {
      return std::nullopt;
    }
    values[count++] = value;
    if (!more) {
      break;
    }
  }
  if (count == 1) {
    return uniform(values[0]);
  }
  return count == values.size() ? std::optional(values) : std::nullopt;
}

Result<std::shared_ptr<const Brdf>> parse(std::string_view spec, const Model& model, std::string_view rest) {
  std::vector<std::optional<ChannelValues>> found(model.keys.size());
  for (bool first = true; !rest.empty(); first = false) {
    const bool dangling = rest.back() == ',';
    const std::string_view item = take(rest, ',');
    if (dangling && rest.empty()) {
      return bad(spec, "ends with a comma, expected another key=value");
    }
    const std::size_t equals = item.find('=');
    // A lone first value belongs to the first key: lambertian:0.5.
    const bool positional = first && equals == std::string_view::npos;
    const std::string_view name = positional ? model.keys.front().name : item.substr(0, equals);
    const std::string_view text =
        positional ? item : (equals == std::string_view::npos ? "" : item.substr(equals + 1));
    const auto key = std::ranges::find(model.keys, name, &Key::name);
    if (key == model.keys.end()) {
      std::string known;
      for (const Key& k : model.keys) {
        known += fmt::format("{}{}", known.empty() ? "" : ", ", k.name);
      }
      return bad(spec, fmt::format("unknown key '{}', expected {}", name, known));
    }
    auto& slot = found[static_cast<std::size_t>(key - model.keys.begin())];
    if (slot) {
      return bad(spec, fmt::format("{} is given twice", name));
    }
    slot = parse_values(text, *key);
    if (!slot) {
      return bad(spec, fmt::format("{} is '{}', expected {}..{} (one number or red/green/blue)", name, text,
                                   key->lowest, key->highest));
    }
  }
  std::vector<ChannelValues> values;
  for (std::size_t k = 0; k < found.size(); ++k) {
    const Key& key = model.keys[k];
    if (!found[k] && !key.otherwise) {
      return bad(spec, fmt::format("{} is missing ({}..{})", key.name, key.lowest, key.highest));
    }
    values.push_back(found[k] ? *found[k] : uniform(*key.otherwise));
  }
  return model.make(values);
}

const Model* find_model(std::string_view spec) {
  const std::size_t colon = spec.find(':');
  if (colon == std::string_view::npos) {
    return nullptr;
  }
  const auto it = std::ranges::find(models(), spec.substr(0, colon), &Model::name);
  return it == models().end() ? nullptr : &*it;
}

}  // namespace

bool is_model_spec(std::string_view spec) noexcept {
  return find_model(spec) != nullptr;
}

Result<std::shared_ptr<const Brdf>> make_model(std::string_view spec) {
  const Model* model = find_model(spec);
  if (model == nullptr) {
    return bad(spec, "unknown model");
  }
  return parse(spec, *model, spec.substr(spec.find(':') + 1));
}

}  // namespace scatter::reflectance
