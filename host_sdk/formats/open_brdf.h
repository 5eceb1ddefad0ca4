// Any BRDF from a path or a model spec: the one entry of tools and simulator.
#pragma once

#include <memory>
#include <string_view>

#include "host_sdk/error/error.h"
#include "host_sdk/reflectance/brdf.h"

namespace scatter::formats {

/// "ggx:alpha=0.2,f0=0.04" (reflectance/models/model_spec.h), "file:PATH" or "PATH"; of an atlas
/// "PATH#NAME", NAME being one of its materials. Files are recognized by their content.
/// Errors  those of the readers; kInvalidArgument: no format that is known; kNotFound.
[[nodiscard]] Result<std::shared_ptr<const reflectance::Brdf>> open_brdf(std::string_view path_or_spec);

/// The same for a file image; `name` goes into messages.
[[nodiscard]] Result<std::shared_ptr<const reflectance::Brdf>> decode_brdf(std::string_view bytes,
                                                                           std::string_view name);

}  // namespace scatter::formats
