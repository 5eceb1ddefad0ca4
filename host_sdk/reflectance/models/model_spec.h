// Analytic models from text, as users write them: "ggx:alpha=0.2,f0=0.04,albedo=0.3".
#pragma once

#include <memory>
#include <string_view>

#include "host_sdk/error/error.h"
#include "host_sdk/reflectance/brdf.h"

namespace scatter::reflectance {

/// True when the text starts with a model's name and a colon; says nothing about the rest.
[[nodiscard]] bool is_model_spec(std::string_view spec) noexcept;

/// The model that a spec names.
///   lambertian:0.5                            albedo (also lambertian:albedo=0.5)
///   ggx:alpha=0.2,f0=0.04,albedo=0.3          f0 = 0.04 and albedo = 0 when left out
///   film:transmittance=0.6,haze=0.3           BTDF
/// A value is one number or three, red/green/blue: albedo=0.3/0.2/0.1.
/// Errors    kInvalidArgument: unknown model or key, key twice or missing, value out of range;
///           names the key, its range and the models.
[[nodiscard]] Result<std::shared_ptr<const Brdf>> make_model(std::string_view spec);

}  // namespace scatter::reflectance
