// What a fit works on: values at geometries, grouped by incidence.
#pragma once

#include <cstddef>
#include <vector>

#include "host_sdk/error/error.h"
#include "host_sdk/reflectance/albedo.h"
#include "host_sdk/reflectance/brdf.h"
#include "host_sdk/reflectance/scattered_samples.h"

namespace scatter::reflectance {

/// Samples of one material, those of an incidence one after another.
///
/// Quantity  f [1/sr], without the cosine; may be slightly negative where noise exceeds the value.
/// Frame     direction.h; the material is taken as isotropic, BRDF only.
struct FitSamples {
  struct Incidence {
    double theta_i = 0;     ///< [rad], 0 .. below pi/2.
    double phi_i = 0;       ///< [rad]
    std::size_t first = 0;  ///< Index of its first sample.
    std::size_t count = 0;  ///< Number of its samples.
  };
  std::size_t channels = 3;
  std::vector<float> wavelengths_nm = {};  ///< One per channel, or empty.
  std::vector<Incidence> incidences = {};
  std::vector<Direction> omega_o = {};      ///< One per sample, z > 0.
  std::vector<double> f_per_sr = {};        ///< [sample * channels + channel]
  std::vector<double> sigma_per_sr = {};    ///< Standard uncertainty, as f_per_sr; empty: unknown.
  std::vector<double> solid_angle_sr = {};  ///< What a sample stands for, one per sample, > 0.

  [[nodiscard]] std::size_t size() const noexcept { return omega_o.size(); }
};

struct GatherOptions {
  Region region = Region::kMeasured;  ///< kAll also takes interpolated and extrapolated nodes.
  /// Samples beyond this elevation are left out [rad]: there the cosine makes errors of angle and
  /// stray light large.
  double theta_o_max = radians(85.0);
  /// More nodes are thinned to about this many: half of them evenly in solid angle, half where the
  /// light goes, each then standing for the nodes that it replaces. 0: all.
  std::size_t max_samples = 20'000;
};

/// The usable nodes of a grid (about the normal or about the specular direction); of any other BRDF
/// every degree of the hemisphere at its own incidences (at most 24 of them), or those of the default
/// GridLayout. Nodes that are exactly 0 in every channel count as not measured: files fill gaps so.
/// Uncertainties are taken when every sample has one above 0. Errors    kInvalidArgument: BTDF;
/// kFailedPrecondition: no usable node.
[[nodiscard]] Result<FitSamples> gather(const Brdf& brdf, const GatherOptions& options = {});

/// The usable ones among loose samples, those of equal omega_i (to 1e-6) as one incidence. Their
/// solid angles are unknown: each stands for an equal part of the hemisphere. total uncertainty =
/// root of the sum of both squares.
/// Errors    as above, and of check(ScatteredSamples).
[[nodiscard]] Result<FitSamples> gather(const ScatteredSamples& samples, const GatherOptions& options = {});

/// About `wanted` of the samples, chosen as in GatherOptions; all when there are no more.
[[nodiscard]] FitSamples thinned(const FitSamples& samples, std::size_t wanted);

/// The samples of the incidences whose entry is true.
/// Shape     keep.size() == samples.incidences.size().
[[nodiscard]] FitSamples only(const FitSamples& samples, const std::vector<bool>& keep);

/// Errors    kInvalidArgument: shapes that do not agree, a NaN or infinite number, a direction below
///           the horizon or of the wrong length, an uncertainty or solid angle that is not positive
///           (names the sample).
[[nodiscard]] Status check(const FitSamples& samples);

}  // namespace scatter::reflectance
