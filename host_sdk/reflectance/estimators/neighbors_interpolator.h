// Between scattered samples: the mean of the nearest ones, weighted by distance.
#pragma once

#include <memory>

#include "host_sdk/error/error.h"
#include "host_sdk/reflectance/estimators/estimator.h"
#include "host_sdk/reflectance/estimators/scattered_brdf.h"

namespace scatter::reflectance {

/// Shepard interpolation over at most `k` sites within `d_max`, weights (d + epsilon)^-2, where d is the
/// distance of (x_i, y_i, x_o, y_o), the tangent-plane components.
///
/// At a site (within 1e-6) its own value and origin; elsewhere kInterpolated or worse. Fewer than
/// `k_min` sites within d_max (k above their number included): kInvalid, never a silent number.
/// Between incidences that lie farther apart than their outgoing directions the nearest sites all belong
/// to one incidence: wrap an IncidenceInterpolator around this link there.
/// Uncertainty  weighted means: neighbours are taken as fully correlated.
/// Changes   to the ScatteredBrdf are seen at once.
/// Source    Shepard 1968; thesis 6.1.3, eq. 38.
class NeighborsInterpolator final : public Estimator {
 public:
  struct Options {
    std::size_t k = 10;      ///< 1..1024.
    double d_max = 0.2;      ///< > 0; 0.2 reaches half-way between incidences 20 deg apart.
    std::size_t k_min = 3;   ///< 1..k.
    double epsilon = 1e-6;   ///< > 0.
    AngularRegion region{};  ///< Elsewhere the samples themselves answer.
  };
  /// Errors  kInvalidArgument: an option out of range.
  [[nodiscard]] static Result<std::shared_ptr<const NeighborsInterpolator>> make(
      std::shared_ptr<const ScatteredBrdf> samples, const Options& options);

 private:
  NeighborsInterpolator(std::shared_ptr<const ScatteredBrdf> samples, const Options& options);
  void estimate(const Direction& omega_i, std::span<const Direction> omega_o, std::span<double> f_per_sr,
                std::span<Origin> origin) const noexcept override;
  [[nodiscard]] bool estimate_uncertainty(const Direction& omega_i, const Direction& omega_o,
                                          std::span<double> random_per_sr,
                                          std::span<double> systematic_per_sr) const noexcept override;
  /// Turns the distances of found neighbours into weights that add up to 1.
  /// Returns  how many count; 0: no value.
  std::size_t weigh(std::span<const search::Neighbor> found, std::span<double> weight) const noexcept;

  std::shared_ptr<const ScatteredBrdf> samples_;
  Options options_;
};

}  // namespace scatter::reflectance
