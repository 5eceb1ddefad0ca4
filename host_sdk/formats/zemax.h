// Zemax tabular BSDF (text): a grid about the specular direction (docs: formats.md 1).
#pragma once

#include <filesystem>
#include <string_view>

#include "host_sdk/error/error.h"
#include "host_sdk/reflectance/specular_grid_brdf.h"

namespace scatter::formats {

/// Channels are those of the file: 1 (Monochrome) or 3 (XYZ or RGB, kept as they are).
/// Metadata "spectral_content", "source", and "notes" (one line each) where the stated total
/// scatter (TIS) and the integral of the values disagree by more than 25 %.
/// Errors  kDataLoss: line, expected, found; `name` goes into messages.
[[nodiscard]] Result<reflectance::SpecularGridBrdf> decode_zemax(std::string_view text,
                                                                 std::string_view name);
[[nodiscard]] Result<reflectance::SpecularGridBrdf> read_zemax(const std::filesystem::path& path);

}  // namespace scatter::formats
