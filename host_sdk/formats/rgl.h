// RGL tensor files (.bsdf): what the RGL database, Mitsuba 3 (spectral) and pbrt-v4 (spectral) use.
// Layout: formats.md 5 and rgl_tensor.h; what the numbers mean: reflectance/adaptive_brdf.h.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "host_sdk/error/error.h"
#include "host_sdk/reflectance/adapted_brdf.h"
#include "host_sdk/reflectance/adaptive_brdf.h"

namespace scatter::formats {

/// RGB or spectral, isotropic or anisotropic (whole, half or quarter turn), fields in any order.
/// Metadata: "description", and what our writer put into fields "scatter.KEY".
/// Memory  the tables of the result are the file's bytes, which it keeps as a whole.
/// Errors  kDataLoss: truncated or damaged; kInvalidArgument: a tensor file without the fields of a
///         BRDF, or a field of another type or shape: names field, expected, found;
///         kVersionMismatch.
[[nodiscard]] Result<reflectance::AdaptiveBrdf> decode_rgl(std::string_view bytes, std::string_view name);
[[nodiscard]] Result<reflectance::AdaptiveBrdf> read_rgl(const std::filesystem::path& path);

/// An AdaptiveBrdf as it is, anything else through reflectance::adapt. One channel is written as
/// three equal ones; other than three with known wavelengths as a spectral file. Deterministic.
/// Errors  kInvalidArgument: BTDF, several channels without wavelengths; those of adapt.
[[nodiscard]] Result<std::string> encode_rgl(const reflectance::Brdf& brdf,
                                             const reflectance::AdaptOptions& options = {});
[[nodiscard]] Status write_rgl(const reflectance::Brdf& brdf, const std::filesystem::path& path,
                               const reflectance::AdaptOptions& options = {});

}  // namespace scatter::formats
