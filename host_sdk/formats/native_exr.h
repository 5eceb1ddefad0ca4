// OpenEXR native grid: the lossless result of a measurement (docs: formats.md 6).
//
// One part per sample rotation and incidence, named "rotation=0 theta_i=20"; x is phi_o, y is
// theta_o, values at the nodes. Channels: R G B (or Y; or L000, L001, ... for other counts), and
// for each of them random.* and systematic.* where known, all 32-bit float; pixels (float);
// origin (half, 0 invalid, 1 measured, 2 interpolated, 3 extrapolated).
// Attributes of every part: bsdfGridVersion (1), bsdfType (BRDF, BTDF), bsdfWavelengths [nm],
// bsdfRotation, bsdfIncidenceTheta, bsdfIncidencePhi, bsdfThetaStep, bsdfPhiStep [deg, double];
// of the first part: the metadata, each key behind "scatter.".
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "host_sdk/error/error.h"
#include "host_sdk/reflectance/grid_brdf.h"

namespace scatter::formats {

/// File image of a grid. The same grid gives the same bytes; floats are kept bit by bit, angles
/// to one unit in the last place. Uncompressed: noise does not compress and a measurement waits.
/// Errors  kInvalidArgument: a metadata key that is empty or longer than 200 characters.
[[nodiscard]] Result<std::string> encode_native_exr(const reflectance::GridBrdf& grid);

/// Grid of a file image. `name` goes into messages.
/// Errors  kDataLoss: truncated or damaged; kInvalidArgument: an EXR image, but no such grid;
///         kVersionMismatch: a newer layout.
[[nodiscard]] Result<reflectance::GridBrdf> decode_native_exr(std::string_view bytes, std::string_view name);

[[nodiscard]] Status write_native_exr(const reflectance::GridBrdf& grid, const std::filesystem::path& path);
[[nodiscard]] Result<reflectance::GridBrdf> read_native_exr(const std::filesystem::path& path);

}  // namespace scatter::formats
