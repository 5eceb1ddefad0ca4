// How far two BRDFs are apart: one set of figures for tests, benchmarks and users.
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "host_sdk/error/error.h"
#include "host_sdk/reflectance/albedo.h"
#include "host_sdk/reflectance/brdf.h"
#include "host_sdk/reflectance/grid_brdf.h"

namespace scatter::reflectance {

struct CompareOptions {
  /// kMeasured: nodes where a is measured and b neither invalid nor extrapolated;
  /// kAll: nodes where both have a value.
  Region region = Region::kMeasured;
};

/// a is what is judged, b the reference. A bin is one node of one incidence; "weighted" means by
/// solid angle, over bins and channels.
struct Comparison {
  std::size_t bins = 0;
  std::size_t bins_without_reference = 0;  ///< b <= 0: left out of the relative errors only.
  double median_relative_error = 0;        ///< |a - b| / b, weighted.
  double mean_relative_error = 0;
  double p95_relative_error = 0;
  double p99_relative_error = 0;
  double cosine_weighted_rms_per_sr = 0;  ///< Root of the weighted mean of ((a - b) cos theta_o)^2.
  double log_rms = 0;                     ///< The same of ln(1 + a cos) - ln(1 + b cos).

  /// One part of a.
  struct Incidence {
    double rotation_rad = 0;
    double theta_i = 0;  ///< [rad]
    double phi_i = 0;    ///< [rad]
    std::size_t bins = 0;
    /// Both integrated over the same bins; largest channel of |a - b|.
    double albedo_error = 0;
    /// Angle between the tops of a and b; nothing where the lobe is not distinct (see compare.cpp).
    std::optional<double> peak_angle_error_deg;
    std::optional<double> peak_ratio;  ///< Height of a / height of b.
  };
  std::vector<Incidence> incidences;

  std::optional<double> peak_angle_error_deg;  ///< Worst incidence.
  std::optional<double> peak_ratio;            ///< The one farthest from 1.

  /// Only when a states uncertainties.
  std::optional<double> reduced_chi_square;  ///< Mean of ((a - b) / random)^2 over bins and channels.
  /// Share of bins and channels with |a - b| <= 1.96 sqrt(random^2 + systematic^2).
  std::optional<double> coverage_95;
};

/// At the nodes and actual incidences of a.
/// A reference with one channel serves every channel of a; one with other channels is matched
/// by the nearest wavelength.
/// Errors  kInvalidArgument: BRDF against BTDF, channels that cannot be matched;
///         kFailedPrecondition: no bin in the region.
[[nodiscard]] Result<Comparison> compare(const GridBrdf& a, const Brdf& b,
                                         const CompareOptions& options = {});

/// Any two: at a's nodes if a is a GridBrdf, else at b's if b is one, else on the default
/// GridLayout.
[[nodiscard]] Result<Comparison> compare(const Brdf& a, const Brdf& b, const CompareOptions& options = {});

}  // namespace scatter::reflectance
