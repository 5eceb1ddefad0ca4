// Between measured incidences: four simple ways, those that other software offers.
#pragma once

#include <memory>
#include <string_view>
#include <vector>

#include "host_sdk/error/error.h"
#include "host_sdk/reflectance/estimators/estimator.h"
#include "host_sdk/reflectance/estimators/extent.h"

namespace scatter::reflectance {

/// Which outgoing directions of two incidences belong together, and how their values are joined.
enum class IncidenceMode : std::uint8_t {
  kPlain,               ///< The same theta_o and phi_o - phi_i; linear in theta_i.
  kSpecular,            ///< The same angles about the mirror direction; linear.
  kSpecularSpline,      ///< Likewise; centripetal Catmull-Rom spline through four incidences.
  kSpecularSplineZero,  ///< Likewise, and 0 below the horizon: what libbsdf does.
  kDistorted,           ///< About the mirror direction, drawn out so that horizon stays horizon; linear.
};
/// "plain", "specular", "specular-spline", "specular-spline-zero", "distorted".
[[nodiscard]] std::string_view name(IncidenceMode mode) noexcept;

/// Answers between the smallest and the largest stored incidence from what the inner link gives at
/// the stored ones; at a stored incidence the inner link's answer as it is.
///
/// Origin    kInterpolated or worse. kSpecular*: where a turned direction falls below the horizon the
///           inner link is asked at the horizon, same azimuth, and the result is kExtrapolated.
///           kInvalid where one of the two neighbours is. kSpecularSpline does without an outer
///           neighbour that is invalid or below the horizon (as at the end of the data).
/// Value     the splines are never negative where the values they go through are not.
/// Uncertainty  random parts of the two incidences add in quadrature, systematic ones linearly, by the
///           linear weights; the error of interpolating is not in it (see GuidedBrdf for one that is).
/// Source    the rows of reflectance.md 6. Distorted: points theta/90 deg from the centre of a unit disk;
///           circles about the mirror point that widen into the rim, after libbsdf's coordinates of that
///           name. Spline: Barry and Goldman 1988 with the knots of Lee 1989, over (theta_i [rad], f [1/sr])
///           in the plane, as libbsdf draws it; an end point doubled.
class IncidenceInterpolator final : public Estimator {
 public:
  /// Errors  kFailedPrecondition: fewer than two incidences.
  ///         kInvalidArgument: incidences not ascending or not in 0..pi/2.
  [[nodiscard]] static Result<std::shared_ptr<const IncidenceInterpolator>> make(
      std::shared_ptr<const Brdf> inner, IncidenceMode mode, const Extent& extent);
  /// Incidences as extent_of(*inner) finds them.
  [[nodiscard]] static Result<std::shared_ptr<const IncidenceInterpolator>> make(
      std::shared_ptr<const Brdf> inner, IncidenceMode mode);

  [[nodiscard]] IncidenceMode mode() const noexcept { return mode_; }
  [[nodiscard]] const std::vector<double>& theta_i() const noexcept { return theta_i_; }

 private:
  IncidenceInterpolator(std::shared_ptr<const Brdf> inner, IncidenceMode mode, const Extent& extent);
  void estimate(const Direction& omega_i, std::span<const Direction> omega_o, std::span<double> f_per_sr,
                std::span<Origin> origin) const noexcept override;
  [[nodiscard]] bool estimate_uncertainty(const Direction& omega_i, const Direction& omega_o,
                                          std::span<double> random_per_sr,
                                          std::span<double> systematic_per_sr) const noexcept override;

  struct Frame;
  class Counterpart;
  [[nodiscard]] Frame frame_of(const Direction& omega_i) const noexcept;
  /// What a direction below the horizon of a stored incidence counts for.
  enum class BelowHorizon : std::uint8_t { kHeld, kMissing, kZero };
  /// Inner values at one stored incidence, of directions that belong to omega_o at the asked one.
  void values_at(const Frame& frame, std::size_t incidence, BelowHorizon below_horizon,
                 std::span<const Direction> omega_o, std::span<double> f_per_sr,
                 std::span<Origin> origin) const noexcept;
  void join_by_spline(const Frame& frame, std::span<const Direction> omega_o, std::span<double> f_per_sr,
                      std::span<Origin> origin) const noexcept;

  IncidenceMode mode_;
  std::vector<double> theta_i_;
  std::optional<double> azimuth_;
};

}  // namespace scatter::reflectance
