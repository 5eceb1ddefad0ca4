// What a BRDF holds and whether it can be true: coverage, energy, reciprocity, symmetry, totals.
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "host_sdk/reflectance/albedo.h"
#include "host_sdk/reflectance/brdf.h"

namespace scatter::reflectance {

/// How far pairs of values that should be equal differ. All channels count alike.
struct Deviation {
  /// Root of the mean square of the difference over that of the pairs' means [1]: tells of peaks.
  double relative_rms = 0;
  /// Median over the pairs of |difference| / mean [1]: tells of the typical direction.
  double median = 0;
  /// Pairs of geometries compared; those with a value that is invalid or extrapolated are not in it.
  std::size_t pairs = 0;
};

/// Shares of the hemisphere's solid angle (1 together), by Origin's number: invalid, measured,
/// interpolated, extrapolated. What `eval` answers counts: a direction past a grid's last row
/// is extrapolated although nothing is stored there.
using OriginShares = std::array<double, 4>;

/// Total scatter (TIS) that a file states, and the same from the values themselves.
struct StatedTotal {
  std::size_t channel = 0;
  double stated = 0;      ///< [1]
  double recomputed = 0;  ///< Integral of f cos(theta_o) over the grid's directions [1].
  double held = 0;        ///< The same with the last radial value held to the horizon [1].
  double unweighted = 0;  ///< Integral of f without the cosine [sr]: near `stated` for cosine-weighted data.
  double ratio = 0;       ///< recomputed / stated; 0 when 0 is stated.
  bool differs = false;   ///< By more than 5 %.
};

struct IncidenceInspection {
  double rotation_rad = 0;  ///< Sample rotation; 0 where the data have none.
  double theta_i = 0;       ///< [rad]
  double phi_i = 0;         ///< [rad]
  OriginShares coverage{};
  /// Of the whole hemisphere, extrapolated directions included; invalid ones count as 0.
  Albedo albedo;
  /// The albedo says nothing: there is no Dirac component, and less than 1 % of the hemisphere has a value or
  /// single directions have one with nothing between them, as in a list.
  bool nothing_known = false;
  /// Share of the largest albedo that extrapolated directions hold [1].
  double extrapolated_albedo_share = 0;
  /// Albedo and Dirac component above 1 in some channel, by more than the quadrature's error.
  bool gains_energy = false;
  /// f at mirror halves about the plane of incidence; absent without a usable pair.
  std::optional<Deviation> mirror_symmetry;
  std::vector<StatedTotal> totals;  ///< One per channel where the file states them, else empty.
};

/// Albedo of the values and the Dirac component together, per channel.
[[nodiscard]] std::vector<double> whole_albedo(const IncidenceInspection& incidence);

/// What all incidences judged say of energy.
struct EnergyBalance {
  std::optional<double> largest_albedo;  ///< Of any channel; absent where no incidence tells one.
  double largest_at = 0;                 ///< theta_i of it [rad].
  double judged_to = 0;                  ///< Largest theta_i judged [rad].
  bool gained = false;                   ///< Some incidence gains energy.

  void add(const IncidenceInspection& incidence);
};

struct Inspection {
  std::vector<IncidenceInspection> incidences;
  /// How many incidences the data have; more than `incidences` where a list or table was thinned to 64.
  std::size_t available_incidences = 0;
  /// Of `incidences`, and where the data have no incidences of their own also at 75, 85 and 88 deg.
  EnergyBalance energy;
  OriginShares origin_shares{};  ///< Mean of the incidences' coverage.
  bool gains_energy = false;     ///< energy.gained
  /// f(i, o) against f(o, i) for every two different theta_i of the incidences, every 5 deg of
  /// azimuth: no interpolation between incidences enters at measured ones. Absent for a BTDF (the
  /// way back starts on the other side) and where no pair has a value both ways.
  std::optional<Deviation> reciprocity;
  std::optional<Deviation> mirror_symmetry;  ///< All incidences together.
  /// The stated totals fit the integral without cosine in most blocks, and the one with it in few.
  bool looks_cosine_weighted = false;
};

struct InspectionOptions {
  /// Light to inspect at; empty: the data's own incidences, 0, 20, 40 and 60 deg where it has none.
  std::vector<Direction> incidences;
  double albedo_tolerance = 1e-4;  ///< Absolute.
};

/// Directions of light at which a BRDF has data of its own (Brdf::own_incidences); 0, 20, 40 and 60 deg
/// at phi 0 for others.
[[nodiscard]] std::vector<Direction> measured_incidences(const Brdf& brdf);

/// At most `most` of them, evenly over the list, the first and last included.
[[nodiscard]] std::vector<Direction> thinned(const std::vector<Direction>& incidences, std::size_t most);

/// Inspects on a grid of 1 deg about the normal.
/// Errors   none: what cannot be told is absent.
/// Cost     per incidence 33,000 evaluations and those of `albedo`.
[[nodiscard]] Inspection inspect(const Brdf& brdf, const InspectionOptions& options = {});

}  // namespace scatter::reflectance
