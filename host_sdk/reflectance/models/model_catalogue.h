// The models that specs can name, with what makes each from its keys' values. Private to this folder.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "host_sdk/reflectance/models/model_channels.h"
#include "host_sdk/reflectance/models/model_spec.h"
#include "host_sdk/reflectance/models/sampled_brdf.h"

namespace scatter::reflectance {

/// What the spec gives for one key, in its range; neither when it is left out and has no default.
struct KeyValue {
  std::optional<ChannelValues> numbers;
  std::string_view word;
};

/// A model, or what is wrong with the keys taken together (one clause for an error message).
using MakeResult = std::expected<std::shared_ptr<const SampledBrdf>, std::string>;

/// Values are in the order of the model's keys.
using MakeModel = MakeResult (*)(std::span<const KeyValue> values);

struct CataloguedModel {
  ModelDescription description;
  MakeModel make = nullptr;
};

[[nodiscard]] const std::vector<CataloguedModel>& model_catalogue();

}  // namespace scatter::reflectance
