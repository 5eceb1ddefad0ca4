// MERL .binary: isotropic BRDF in half and difference angles (docs: formats.md 3).
//
// Three int32 counts (theta_h, theta_d, phi_d), then float64 in planes red, green, blue, index
// phi_d + n_phi (theta_d + n_theta_d theta_h); all little endian. f = value / 1500, value * 1.15 / 1500,
// value * 1.66 / 1500 [1/sr]; a negative value is none. The counts are 90 x 90 x 180, in the variant
// for models that are not reciprocal 90 x 90 x 360. Other sizes with phi_d twice (four times) theta_d
// are read alike.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "host_sdk/error/error.h"
#include "host_sdk/reflectance/half_difference_brdf.h"

namespace scatter::formats {

/// Values as float.
/// Errors  kDataLoss: truncated, or longer than its counts say; NaN or infinity;
///         kInvalidArgument: other counts.
[[nodiscard]] Result<reflectance::HalfDifferenceBrdf> decode_merl(std::string_view bytes,
                                                                  std::string_view name);
/// In one pass with a small buffer: no more memory than the result's.
[[nodiscard]] Result<reflectance::HalfDifferenceBrdf> read_merl(const std::filesystem::path& path);

struct MerlOptions {
  bool reciprocal = true;  ///< 180 cells of phi_d; else 360. A HalfDifferenceBrdf keeps its own.
};

/// f at the centres of the cells, -1 where there is no value. A HalfDifferenceBrdf is written as it is.
/// One channel is written as three equal ones; of more than three those nearest to 630, 525 and 465 nm.
/// Losses  anisotropy (the light comes from azimuth 0), uncertainties, origins, metadata; detail
///         finer than a cell.
/// Errors  kInvalidArgument: BTDF; two channels, or more than three without wavelengths.
[[nodiscard]] Result<std::string> encode_merl(const reflectance::Brdf& brdf, const MerlOptions& options = {});
[[nodiscard]] Status write_merl(const reflectance::Brdf& brdf, const std::filesystem::path& path,
                                const MerlOptions& options = {});

}  // namespace scatter::formats
