// Measurements at single pairs of directions, in no order and on no grid.
#pragma once

#include <cstddef>
#include <map>
#include <string>
#include <vector>

#include "host_sdk/error/error.h"
#include "host_sdk/reflectance/brdf.h"

namespace scatter::reflectance {

/// A list of samples: what formats without a grid hold, what estimators and fits start from.
///
/// Quantity  f and its standard uncertainties [1/sr]; the cosine is NOT included.
/// Shape     values of one sample lie together: f_per_sr[sample * channels + channel].
struct ScatteredSamples {
  ScatterType type = ScatterType::kBrdf;
  std::size_t channels = 3;
  std::vector<float> wavelengths_nm;  ///< One per channel [nm]; empty = unknown.
  std::vector<Direction> omega_i;     ///< Unit vectors towards the light, z > 0.
  std::vector<Direction> omega_o;     ///< Towards the detector, as many; z >= 0 for BRDF, z <= 0 for BTDF.
  std::vector<float> f_per_sr;
  std::vector<float> random_per_sr;      ///< Shape of f_per_sr; empty = unknown.
  std::vector<float> systematic_per_sr;  ///< Likewise.
  std::vector<Origin> origin;            ///< One per sample; empty = all measured.
  /// Provenance, as GridBrdf::Content::metadata.
  std::map<std::string, std::string> metadata;

  [[nodiscard]] std::size_t size() const noexcept { return omega_i.size(); }
  [[nodiscard]] Origin origin_of(std::size_t sample) const noexcept {
    return origin.empty() ? Origin::kMeasured : origin[sample];
  }
};

/// Whether sizes agree, directions are unit vectors (to 1e-6) on their sides, and the numbers of every
/// sample that is not kInvalid are finite (uncertainties also >= 0). No samples at all are fine.
/// Errors  kInvalidArgument naming the sample and what was expected.
[[nodiscard]] Status check(const ScatteredSamples& samples);

/// The directions of light among the samples that are not kInvalid, each once (within 1e-5 rad), by
/// ascending theta_i and then azimuth.
[[nodiscard]] std::vector<Direction> incidences_of(const ScatteredSamples& samples);

}  // namespace scatter::reflectance
