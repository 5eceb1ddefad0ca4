// Between measured incidences: what changes slowly is interpolated, in the way that fits the material.
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "host_sdk/error/error.h"
#include "host_sdk/reflectance/estimators/estimator.h"
#include "host_sdk/reflectance/estimators/extent.h"
#include "host_sdk/reflectance/estimators/guided_mixture.h"
#include "host_sdk/reflectance/estimators/guided_predictor.h"

namespace scatter::reflectance {

/// Answers between the smallest and the largest stored incidence; at a stored incidence the inner
/// link's answer as it is.
///
/// Value     exp of a weighted mean of several interpolations of ln(f / model), each with one of the
///           fitted models (or none), aligned plainly, about the mirror direction or by half vector.
///           Models, ways and weights are those that predict held-back incidences best, by region of
///           the outgoing direction. Never negative.
/// Origin    kInterpolated where both neighbouring incidences have a measured value in the same
///           direction, else kExtrapolated (past the last theta_o the ratio to the model is held).
///           Never kInvalid above the horizon: blind spots of the data are filled from around them.
/// Uncertainty  relative ones of the two neighbours: random in quadrature, systematic linearly; to the
///           systematic part the error found by cross-validation is added in quadrature, times
///           4 s (1 - s), s being the place between the neighbours. The held-back incidences had
///           neighbours twice as far apart, so that it is on the safe side.
/// Several sample rotations  each for itself, then as GridBrdf: linear in phi_i where they lie at most
///           90 deg apart, else the nearest. One rotation: the sample is taken as isotropic.
/// Source    reflectance.md 3 ("a better one is wanted"); docs/decisions/0008.
class GuidedBrdf final : public Estimator {
 public:
  /// Errors  kFailedPrecondition: fewer than two incidences, one without a measured value, a channel
  ///         without a positive one;
  ///         kInvalidArgument: incidences not ascending in 0..pi/2.
  /// Cost    see select_guided; memory: 4 bytes per value and model in use, and once for the values.
  [[nodiscard]] static Result<std::shared_ptr<const GuidedBrdf>> make(std::shared_ptr<const Brdf> inner);
  [[nodiscard]] static Result<std::shared_ptr<const GuidedBrdf>> make(std::shared_ptr<const Brdf> inner,
                                                                      const Extent& extent);

  /// What was chosen, one entry per sample rotation.
  [[nodiscard]] std::vector<const GuidedMixture*> mixtures() const;
  /// Mean error of the held-back incidences over all rotations (GuidedMixture::error).
  [[nodiscard]] std::optional<double> cross_validation_error() const noexcept;
  /// For the files written from here: "interpolation", "interpolation_error",
  /// "interpolation_error_specular_linear".
  [[nodiscard]] std::map<std::string, std::string> metadata() const;

 private:
  /// One sample rotation.
  struct Rotation {
    GuidedData data;
    GuidedMixture mixture;
    std::optional<GuidedPredictor> predictor;
  };
  struct Share {
    std::size_t rotation = 0;
    double share = 0;
  };
  GuidedBrdf(std::shared_ptr<const Brdf> inner, const AngularRegion& region, const Extent& extent,
             std::vector<std::unique_ptr<Rotation>> rotations);

  void estimate(const Direction& omega_i, std::span<const Direction> omega_o, std::span<double> f_per_sr,
                std::span<Origin> origin) const noexcept override;
  [[nodiscard]] bool estimate_uncertainty(const Direction& omega_i, const Direction& omega_o,
                                          std::span<double> random_per_sr,
                                          std::span<double> systematic_per_sr) const noexcept override;
  [[nodiscard]] bool stored(double theta_i) const noexcept;
  /// As the inner link is asked at a stored incidence: turned to the data's azimuth when there is one.
  [[nodiscard]] Direction asked(const Direction& w, double turn) const noexcept;
  [[nodiscard]] std::vector<Share> rotations_at(double phi_i) const noexcept;
  void interpolate(const Rotation& rotation, double theta_i, double phi_i, std::span<const Direction> omega_o,
                   std::span<double> f_per_sr, std::span<Origin> origin) const noexcept;

  Extent extent_;
  std::vector<std::unique_ptr<Rotation>> rotations_;  ///< By azimuth.
};

}  // namespace scatter::reflectance
