// Analytic models from text, as users write them: "ggx:alpha=0.2,f0=0.04,albedo=0.3".
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "host_sdk/error/error.h"
#include "host_sdk/reflectance/brdf.h"
#include "host_sdk/reflectance/models/sampled_brdf.h"

namespace scatter::reflectance {

/// One key of a model's spec.
struct ModelKey {
  enum class Kind : std::uint8_t {
    kColour,  ///< One number or red/green/blue.
    kNumber,  ///< One number.
    kWord,    ///< A name, such as a metal's.
  };
  std::string_view name;
  Kind kind = Kind::kColour;
  double lowest = 0;
  double highest = 1;
  bool required = false;
  std::optional<double> otherwise{};  ///< Its value when left out; none: what docs/models.md says.
};

/// One model that a spec can name.
struct ModelDescription {
  std::string_view name;
  std::string_view what;  ///< One phrase.
  std::vector<ModelKey> keys;
};

/// All of them, in the order of docs/models.md; `sum` (below) has no keys of its own.
[[nodiscard]] std::span<const ModelDescription> model_descriptions();

/// True when the text starts with a model's name and a colon; says nothing about the rest.
[[nodiscard]] bool is_model_spec(std::string_view spec) noexcept;

/// The model that a spec names: NAME:KEY=VALUE,KEY=VALUE,... Models, keys and formulas: docs/models.md.
///   lambertian:0.5                            a lone first value belongs to the first key
///   ggx:alpha=0.2,f0=0.04,albedo=0.3          f0 = 0.04 and albedo = 0 when left out
///   conductor:metal=copper,alpha=0.2
///   sum:ggx:alpha=0.1,weight=0.5,ward:alpha=0.3,ks=0.2,lambertian:0.3
///     the sum of models that reflect; each part starts at its NAME: and may have a weight (0..1)
/// A value is one number or three, red/green/blue: albedo=0.3/0.2/0.1.
/// Errors    kInvalidArgument: unknown model or key, key twice or missing, value out of range;
///           names the key, its range and the models.
[[nodiscard]] Result<std::shared_ptr<const SampledBrdf>> make_sampled_model(std::string_view spec);

/// The same behind the common interface.
[[nodiscard]] Result<std::shared_ptr<const Brdf>> make_model(std::string_view spec);

}  // namespace scatter::reflectance
