// MiniDiff / LightTools BSDF (text): what the commercial instrument writes (docs/formats.md).
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "host_sdk/error/error.h"
#include "host_sdk/reflectance/grid_brdf.h"

namespace scatter::formats {

/// One block per incidence and channel: azimuths 0..360 (rows) x radials 0..90 (columns) about the
/// normal in the grid's own steps (361 x 91 for 1 deg, as the instrument's software writes), values
/// with `digits` significant digits (0: seven). Azimuth is phi_o and POI phi_i of
/// reflectance/direction.h. Beyond the grid's last theta_o the last value goes on, where the grid is
/// invalid the nearest valid one of the same azimuth stands, and "#" lines say so; further "#" lines
/// carry origins, rotations and metadata for our reader. Uncertainties are lost. No time stamp: the
/// same grid gives the same bytes.
/// Three channels without wavelengths become tristimulus values (docs/decisions/0007), which our
/// reader turns back.
/// Errors  kInvalidArgument: two, four or more channels without wavelengths, digits out of range.
[[nodiscard]] Result<std::string> encode_minidiff(const reflectance::GridBrdf& grid, int digits = 0);
[[nodiscard]] Status write_minidiff(const reflectance::GridBrdf& grid, const std::filesystem::path& path,
                                    int digits = 0);

/// Everything is taken as measured, except beyond the radial that a line "#Extrapolated beyond
/// radial 75" (ours) names, and as our comments say. An incidence that comes with several POI means
/// that the sample was rotated; plane-symmetric data are mirrored. Uneven angles become the even grid
/// that has them all as nodes, what lies between is kInterpolated. XYZ: three channels as they are,
/// metadata "spectral_content". Metadata also "sample", "side", "comments" (those of others), and
/// "notes" where TIS and the integral of the values differ by more than 5 %, and "warnings" (one line
/// each) of a TIS below 0 or above 1.2. Model may be missing (it names the sample and nothing else); a
/// Wavelength is 100..1000000 nm, or 0 where there is one channel, or tristimulus values.
/// Errors  kDataLoss: line, expected, found. kUnimplemented, with the line: angles of which no even grid
///         of sensible size can be made, or several scatter types or sides in one file.
[[nodiscard]] Result<reflectance::GridBrdf> decode_minidiff(std::string_view text, std::string_view name);
[[nodiscard]] Result<reflectance::GridBrdf> read_minidiff(const std::filesystem::path& path);

}  // namespace scatter::formats
