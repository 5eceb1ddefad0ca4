#include "host_sdk/reflectance/models/model_spec.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <string>
#include <utility>

#include "host_sdk/reflectance/models/lobe_model.h"
#include "host_sdk/reflectance/models/model_catalogue.h"

namespace scatter::reflectance {
namespace {

constexpr std::string_view kSum = "sum";
constexpr ModelKey kWeight{.name = "weight", .otherwise = 1.0};
/// Longer texts are no spec that anybody wrote.
constexpr std::size_t kMaxLength = 4096;

std::unexpected<Error> bad(std::string_view spec, const std::string& what, std::string remedy) {
  return fail(ErrorCode::kInvalidArgument,
              fmt::format("model '{}{}': {}", spec.substr(0, 200), spec.size() > 200 ? "..." : "", what),
              std::move(remedy));
}

std::string model_names() {
  std::string names;
  for (const CataloguedModel& model : model_catalogue()) {
    names += fmt::format("{}, ", model.description.name);
  }
  return fmt::format("{}{}", names, kSum);
}

/// "use ggx:alpha=0.001..1[,f0=0..1]; ..." for a model that is known.
std::string usage(const ModelDescription& model) {
  std::string keys;
  for (const ModelKey& key : model.keys) {
    const std::string item = key.kind == ModelKey::Kind::kWord
                                 ? fmt::format("{}=NAME", key.name)
                                 : fmt::format("{}={:.4g}..{:.4g}", key.name, key.lowest, key.highest);
    const std::string_view comma = keys.empty() ? "" : ",";
    keys += key.required ? fmt::format("{}{}", comma, item) : fmt::format("[{}{}]", comma, item);
  }
  return fmt::format("use {}:{}, colours as one number or red/green/blue; models are {}", model.name, keys,
                     model_names());
}

/// Cuts and returns the text before the first separator.
std::string_view take(std::string_view& text, char separator) {
  const std::size_t at = std::min(text.find(separator), text.size());
  const std::string_view head = text.substr(0, at);
  text.remove_prefix(std::min(at + 1, text.size()));
  return head;
}

std::optional<ChannelValues> parse_numbers(std::string_view text, const ModelKey& key) {
  ChannelValues values{};
  const std::size_t most = key.kind == ModelKey::Kind::kColour ? values.size() : 1;
  std::size_t count = 0;
  while (true) {
    const bool more = text.find('/') != std::string_view::npos;
    const std::string_view number = take(text, '/');
    double value = 0;
    const auto [end, error] = std::from_chars(number.data(), number.data() + number.size(), value);
    if (error != std::errc{} || end != number.data() + number.size() || count == most ||
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

std::string expectation(const ModelKey& key) {
  switch (key.kind) {
    case ModelKey::Kind::kWord:
      return "a name";
    case ModelKey::Kind::kNumber:
      return fmt::format("{}..{} (one number)", key.lowest, key.highest);
    case ModelKey::Kind::kColour:
      break;
  }
  return fmt::format("{}..{} (one number or red/green/blue)", key.lowest, key.highest);
}

/// KEY=VALUE,... of one model; `keys` are the model's and perhaps a weight.
class SpecReader {
 public:
  SpecReader(std::string_view spec, const CataloguedModel& model, std::vector<ModelKey> keys)
      : spec_(spec), model_(model), keys_(std::move(keys)), values_(keys_.size()), seen_(keys_.size()) {}

  [[nodiscard]] Status read(std::string_view rest) {
    for (bool first = true; !rest.empty(); first = false) {
      const bool dangling = rest.back() == ',';
      const std::string_view item = take(rest, ',');
      if (dangling && rest.empty()) {
        return refuse("ends with a comma, expected another key=value");
      }
      if (auto status = read_item(item, first); !status) {
        return status;
      }
    }
    for (std::size_t k = 0; k < keys_.size(); ++k) {
      const ModelKey& key = keys_[k];
      if (!seen_[k] && key.required) {
        return refuse(fmt::format("{} is missing ({:.4g}..{:.4g})", key.name, key.lowest, key.highest));
      }
      if (!seen_[k] && key.otherwise) {
        values_[k].numbers = uniform(*key.otherwise);
      }
    }
    return {};
  }

  [[nodiscard]] std::span<const KeyValue> values() const noexcept { return values_; }
  [[nodiscard]] std::unexpected<Error> refuse(const std::string& what) const {
    return bad(spec_, what, usage(model_.description));
  }

 private:
  [[nodiscard]] Status read_item(std::string_view item, bool first) {
    const std::size_t equals = item.find('=');
    // A lone first value belongs to the first key: lambertian:0.5.
    const bool positional = first && equals == std::string_view::npos;
    const std::string_view name = positional ? keys_.front().name : item.substr(0, equals);
    const std::string_view text =
        positional ? item : (equals == std::string_view::npos ? "" : item.substr(equals + 1));
    const auto key = std::ranges::find(keys_, name, &ModelKey::name);
    if (key == keys_.end()) {
      std::string known;
      for (const ModelKey& k : keys_) {
        known += fmt::format("{}{}", known.empty() ? "" : ", ", k.name);
      }
      return refuse(fmt::format("unknown key '{}', expected {}", name, known));
    }
    const auto at = static_cast<std::size_t>(key - keys_.begin());
    if (seen_[at]) {
      return refuse(fmt::format("{} is given twice", name));
    }
    seen_[at] = true;
    if (key->kind == ModelKey::Kind::kWord) {
      values_[at].word = text;
    } else {
      values_[at].numbers = parse_numbers(text, *key);
    }
    if (text.empty() || (key->kind != ModelKey::Kind::kWord && !values_[at].numbers)) {
      return refuse(fmt::format("{} is '{}', expected {}", name, text, expectation(*key)));
    }
    return {};
  }

  std::string_view spec_;
  const CataloguedModel& model_;
  std::vector<ModelKey> keys_;
  std::vector<KeyValue> values_;
  std::vector<bool> seen_;
};

using SampledResult = Result<std::shared_ptr<const SampledBrdf>>;

const CataloguedModel* find_model(std::string_view name) {
  const auto it = std::ranges::find_if(
      model_catalogue(), [&](const CataloguedModel& model) { return model.description.name == name; });
  return it == model_catalogue().end() ? nullptr : &*it;
}

/// The text before the first colon; nothing without one.
std::optional<std::string_view> name_of(std::string_view spec) {
  const std::size_t colon = spec.find(':');
  return colon == std::string_view::npos ? std::nullopt : std::optional(spec.substr(0, colon));
}

SampledResult make_one(std::string_view spec, const CataloguedModel& model, std::string_view rest) {
  SpecReader reader(spec, model, model.description.keys);
  if (auto status = reader.read(rest); !status) {
    return std::unexpected(std::move(status.error()));
  }
  auto made = model.make(reader.values());
  if (!made) {
    return reader.refuse(made.error());
  }
  return std::move(*made);
}

/// Where the next part of a sum starts: behind the comma before the next "NAME:".
std::size_t part_length(std::string_view rest) {
  const std::size_t own = rest.find(':');
  const std::size_t next = own == std::string_view::npos ? own : rest.find(':', own + 1);
  const std::size_t comma = next == std::string_view::npos ? next : rest.rfind(',', next);
  return comma == std::string_view::npos || comma < own ? rest.size() : comma;
}

/// Adds one weighted part to a sum.
Status add_part(std::string_view spec, std::string_view part, std::vector<WeightedLobe>& lobes,
                ChannelValues& mirror) {
  const auto name = name_of(part);
  const CataloguedModel* model = name ? find_model(*name) : nullptr;
  if (model == nullptr) {
    return bad(spec, fmt::format("'{}' starts with no model, expected NAME:key=value,...", part),
               fmt::format("use sum:NAME:...,NAME:...; models are {}", model_names()));
  }
  std::vector<ModelKey> keys = model->description.keys;
  keys.push_back(kWeight);
  SpecReader reader(spec, *model, std::move(keys));
  if (auto status = reader.read(part.substr(name->size() + 1)); !status) {
    return status;
  }
  const auto made = model->make(reader.values().first(model->description.keys.size()));
  if (!made) {
    return reader.refuse(made.error());
  }
  const auto* summand = dynamic_cast<const LobeModel*>(made->get());
  if (summand == nullptr) {
    return bad(spec, fmt::format("{} cannot be summed, expected models that reflect", *name),
               "leave it out, or use it alone");
  }
  const ChannelValues weight = *reader.values().back().numbers;
  for (WeightedLobe lobe : summand->lobes()) {
    for (std::size_t c = 0; c < kModelChannels; ++c) {
      lobe.weight[c] *= weight[c];
    }
    lobes.push_back(std::move(lobe));
  }
  for (std::size_t c = 0; c < kModelChannels; ++c) {
    mirror[c] += weight[c] * summand->mirror()[c];
  }
  return {};
}

SampledResult make_sum(std::string_view spec, std::string_view rest) {
  std::vector<WeightedLobe> lobes;
  ChannelValues mirror{};
  do {
    const std::string_view part = rest.substr(0, part_length(rest));
    rest.remove_prefix(part.size());
    if (auto status = add_part(spec, part, lobes, mirror); !status) {
      return std::unexpected(std::move(status.error()));
    }
    if (!rest.empty()) {
      rest.remove_prefix(1);
    }
  } while (!rest.empty());
  if (std::ranges::any_of(mirror, [](double share) { return share > 1; })) {
    return bad(spec, "the mirrors' weighted reflectances add up to more than 1", "give them smaller weights");
  }
  return std::make_shared<LobeModel>(std::move(lobes), mirror);
}

}  // namespace

std::span<const ModelDescription> model_descriptions() {
  static const std::vector<ModelDescription> kDescriptions = [] {
    std::vector<ModelDescription> out;
    for (const CataloguedModel& model : model_catalogue()) {
      out.push_back(model.description);
    }
    out.push_back({kSum, "sum of models that reflect: NAME:key=value,...,weight=w,NAME:...", {}});
    return out;
  }();
  return kDescriptions;
}

bool is_model_spec(std::string_view spec) noexcept {
  const auto name = name_of(spec);
  return name && (*name == kSum || find_model(*name) != nullptr);
}

SampledResult make_sampled_model(std::string_view spec) {
  const auto name = name_of(spec);
  if (!name || !is_model_spec(spec)) {
    return bad(spec, "unknown model", fmt::format("use NAME:key=value,... with one of {}", model_names()));
  }
  if (spec.size() > kMaxLength) {
    return bad(spec, fmt::format("has {} characters, expected at most {}", spec.size(), kMaxLength),
               "shorten it");
  }
  const std::string_view rest = spec.substr(name->size() + 1);
  return *name == kSum ? make_sum(spec, rest) : make_one(spec, *find_model(*name), rest);
}

Result<std::shared_ptr<const Brdf>> make_model(std::string_view spec) {
  return make_sampled_model(spec);
}

}  // namespace scatter::reflectance
