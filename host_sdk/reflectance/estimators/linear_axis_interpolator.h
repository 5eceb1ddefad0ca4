// Between scattered samples that lie on common angles: linear along each spherical axis.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "host_sdk/error/error.h"
#include "host_sdk/reflectance/estimators/estimator.h"
#include "host_sdk/reflectance/estimators/scattered_brdf.h"

namespace scatter::reflectance {

/// Takes the nearest sites on either side along theta_i, phi_i (unless the sample is isotropic), theta_o and
/// phi_o - phi_i, one axis after the other, and joins them linearly.
///
/// Needs samples in rings: several azimuths at the same theta_o of the same incidence (angles equal to
/// 1e-5 rad), as goniometers give them; steps may be uneven and points may be missing. kInvalid: outside the
/// rings (inside the first one too, unless it is the pole), where two neighbours lie more than `widest_gap`
/// apart, and so almost everywhere on samples in no order.
/// Origin    at a site its own; elsewhere kInterpolated or worse.
/// Uncertainty  weighted means: neighbours are taken as fully correlated.
/// Changes   to the ScatteredBrdf after `make` are not seen: make a new one.
/// Source    thesis 6.1.3.
class LinearAxisInterpolator final : public Estimator {
 public:
  struct Options {
    double widest_gap = radians(30);   ///< Between neighbours in theta_o or phi_o [rad], > 0.
    double widest_turn = radians(90);  ///< Between two azimuths of the light [rad], > 0.
    AngularRegion region{};            ///< Elsewhere the samples themselves answer.
  };
  /// Errors  kInvalidArgument: an option out of range.
  [[nodiscard]] static Result<std::shared_ptr<const LinearAxisInterpolator>> make(
      std::shared_ptr<const ScatteredBrdf> samples, const Options& options);

 private:
  struct Azimuth {
    double phi = 0;  ///< From the light's, 0..2 pi [rad]; along the normal from x.
    std::uint32_t site = 0;
  };
  struct Ring {
    double theta_o = 0;
    std::vector<Azimuth> azimuths;  ///< Ascending.
  };
  struct Light {
    double phi_i = 0;
    std::vector<Ring> rings;  ///< By ascending theta_o.
  };
  struct Incidence {
    double theta_i = 0;
    std::vector<Light> lights;  ///< By ascending phi_i, 0..2 pi.
  };
  struct Tap {
    std::uint32_t site = 0;
    double weight = 0;
  };
  class Taps;

  LinearAxisInterpolator(std::shared_ptr<const ScatteredBrdf> samples, const Options& options);
  void estimate(const Direction& omega_i, std::span<const Direction> omega_o, std::span<double> f_per_sr,
                std::span<Origin> origin) const noexcept override;
  [[nodiscard]] bool estimate_uncertainty(const Direction& omega_i, const Direction& omega_o,
                                          std::span<double> random_per_sr,
                                          std::span<double> systematic_per_sr) const noexcept override;

  /// Sites and shares for one geometry; nothing when there is no value.
  [[nodiscard]] Taps taps_at(const Direction& omega_i, const Direction& omega_o) const noexcept;
  [[nodiscard]] bool add_incidence(const Incidence& incidence, double phi_i, double theta_o, double phi_o,
                                   double weight, Taps& taps) const noexcept;
  [[nodiscard]] bool add_light(const Light& light, double theta_o, double phi, double weight,
                               Taps& taps) const noexcept;
  [[nodiscard]] bool add_ring(const Ring& ring, double phi, double weight, Taps& taps) const noexcept;

  std::shared_ptr<const ScatteredBrdf> samples_;
  Options options_;
  std::vector<Incidence> incidences_;  ///< By ascending theta_i.
};

}  // namespace scatter::reflectance
