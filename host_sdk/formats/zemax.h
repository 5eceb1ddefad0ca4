// Zemax tabular BSDF (text): a grid about the specular direction (docs/formats.md).
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "host_sdk/error/error.h"
#include "host_sdk/reflectance/specular_grid_brdf.h"

namespace scatter::formats {

struct ZemaxOptions {
  int digits = 0;  ///< Significant digits 1..17; 0: four (%.3E), seven of tristimulus values.
  /// Three channels as they are, in sections TristimulusR, G, B under SpectralContent RGB (few
  /// programs know it), instead of as tristimulus values X, Y, Z (docs/decisions/0007).
  bool rgb_sections = false;
};

/// PlaneSymmetrical where both halves agree to the digits written, else Asymmetrical, or
/// Asymmetrical4D for several rotations; Monochrome, XYZ or RGB. TIS is the integral of what is
/// written. Origins, wavelengths and metadata go into comments that the reader knows. No time
/// stamp: the same grid gives the same bytes.
/// Errors  kInvalidArgument: other than 1 or 3 channels, digits out of range.
[[nodiscard]] Result<std::string> encode_zemax(const reflectance::SpecularGridBrdf& grid,
                                               const ZemaxOptions& options = {});
[[nodiscard]] Status write_zemax(const reflectance::SpecularGridBrdf& grid, const std::filesystem::path& path,
                                 const ZemaxOptions& options = {});

/// Channels are those of the file: 1 (Monochrome) or 3 (XYZ or RGB, kept as they are; XYZ of our
/// own writer is turned back into the RGB that it was made of). Metadata "spectral_content",
/// "source", "comments" (those of others), and "notes" (one line each): where the stated total
/// scatter (TIS) and the integral of the values differ by more than 5 %, both with their ratio,
/// and when the values look cosine-weighted. Metadata "warnings" (one line each): a stated total
/// below 0 or above 1.2, with its line, and angles that look like radians.
/// Errors  kDataLoss: line, expected, found; `name` goes into messages. Every keyword of the header
///         must be there once, angles within their ranges in ascending order.
/// Cost    one pass, about 10 ns per value; memory in proportion to the text.
[[nodiscard]] Result<reflectance::SpecularGridBrdf> decode_zemax(std::string_view text,
                                                                 std::string_view name);
[[nodiscard]] Result<reflectance::SpecularGridBrdf> read_zemax(const std::filesystem::path& path);

}  // namespace scatter::formats
