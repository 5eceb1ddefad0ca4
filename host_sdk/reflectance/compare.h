// How far two BRDFs are apart: one set of figures for tests, benchmarks and users.
#pragma once

#include <cstddef>
#include <cstdint>
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

/// Which channels of a and b were held against each other.
struct ChannelMatch {
  struct Pair {
    std::size_t a = 0;
    std::size_t b = 0;
  };
  enum class By : std::uint8_t {
    kOrder,       ///< As many channels, in their order.
    kOneForAll,   ///< One of them has one channel, which stands against every channel of the other.
    kWavelength,  ///< Each channel of a against the nearest one of b.
    kAssumedRgb,  ///< The same, with 650, 550 and 450 nm for three channels that state no wavelengths.
  };
  By by = By::kOrder;
  std::vector<Pair> pairs;
};

/// a is what is judged, b the reference. A bin is one node of one incidence; "weighted" means by
/// solid angle, over bins and pairs of channels.
struct Comparison {
  ChannelMatch channels;
  std::size_t bins = 0;
  std::size_t bins_without_reference = 0;  ///< b <= 0: left out of the relative errors only.
  bool relative_errors_known = true;       ///< False where b > 0 nowhere: the next four are then 0.
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
    /// Both integrated over the same bins, and the Dirac components added; largest pair of |a - b|.
    double albedo_error = 0;
    /// Share of the light that leaves in exactly one direction, which is in no bin; of the pair of channels
    /// that differs most.
    double dirac_a = 0;
    double dirac_b = 0;
    /// Angle between the tops of a and b; nothing where the lobe is not distinct (see compare.cpp).
    std::optional<double> peak_angle_error_deg;
    std::optional<double> peak_ratio;  ///< Height of a / height of b.
  };
  std::vector<Incidence> incidences;
  /// How many the data have; more than `incidences` where a table of many was thinned. 0: all were used.
  std::size_t available_incidences = 0;

  std::optional<double> peak_angle_error_deg;  ///< Worst incidence.
  std::optional<double> peak_ratio;            ///< The one farthest from 1.

  /// Only when a states uncertainties.
  std::optional<double> reduced_chi_square;  ///< Mean of ((a - b) / random)^2 over bins and channels.
  /// Share of bins and channels with |a - b| <= 1.96 sqrt(random^2 + systematic^2).
  std::optional<double> coverage_95;
};

/// At the nodes and actual incidences of a.
/// Channels are matched as ChannelMatch says, by wavelength where both state them and their numbers differ.
/// Errors  kInvalidArgument: BRDF against BTDF, channels that cannot be matched;
///         kFailedPrecondition: no bin in the region.
[[nodiscard]] Result<Comparison> compare(const GridBrdf& a, const Brdf& b,
                                         const CompareOptions& options = {});

/// Any two: at a's nodes if a is a GridBrdf, else at b's if b is one, else every degree of the hemisphere at
/// a's own incidences (or b's, or those of the default GridLayout), evenly thinned where they are very many.
[[nodiscard]] Result<Comparison> compare(const Brdf& a, const Brdf& b, const CompareOptions& options = {});

}  // namespace scatter::reflectance
