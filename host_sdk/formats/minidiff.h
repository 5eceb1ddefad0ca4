// MiniDiff / LightTools BSDF (text): what the commercial instrument writes (docs: formats.md 2).
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "host_sdk/error/error.h"
#include "host_sdk/reflectance/grid_brdf.h"

namespace scatter::formats {

/// Blocks of 361 azimuths (rows) x 91 radials (columns) about the normal in 1 deg steps, one per
/// incidence and channel, values with seven digits; azimuth is phi_o and POI phi_i of
/// reflectance/direction.h. The format knows no origin and no uncertainty: beyond the grid's last
/// theta_o the last value goes on, where the grid is invalid the nearest valid one of the same
/// azimuth stands, and "#" lines say so. No time stamp: the same grid gives the same bytes.
/// Errors  kInvalidArgument: several channels without wavelengths.
[[nodiscard]] Result<std::string> encode_minidiff(const reflectance::GridBrdf& grid);
[[nodiscard]] Status write_minidiff(const reflectance::GridBrdf& grid, const std::filesystem::path& path);

/// Everything is taken as measured, except beyond the radial that a line "#Extrapolated beyond
/// radial 75" (ours) names. An incidence that comes with several POI means that the sample was
/// rotated; plane-symmetric data are mirrored.
/// Errors  kDataLoss: line, expected, found. kUnimplemented: uneven angles, XYZ, or several
///         scatter types or sides in one file.
[[nodiscard]] Result<reflectance::GridBrdf> decode_minidiff(std::string_view text, std::string_view name);
[[nodiscard]] Result<reflectance::GridBrdf> read_minidiff(const std::filesystem::path& path);

}  // namespace scatter::formats
