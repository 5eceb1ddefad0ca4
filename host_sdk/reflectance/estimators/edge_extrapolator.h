// Beyond the edge of the measured region: the value on the edge, held or faded.
#pragma once

#include <memory>

#include "host_sdk/error/error.h"
#include "host_sdk/reflectance/estimators/edge.h"

namespace scatter::reflectance {

/// f = factor(angle beyond the edge) * f on the edge.
///
/// Origin    kExtrapolated; kInvalid where the edge has no value.
/// Uncertainty  that of the edge times the factor. How far the surface departs from the assumption is not
///           known and not in it: that is what the origin says.
class EdgeExtrapolator : public Estimator {
 public:
  [[nodiscard]] const Edge& edge() const noexcept { return edge_; }

 protected:
  EdgeExtrapolator(std::shared_ptr<const Brdf> inner, const Edge& edge);
  /// kInvalidArgument unless 0 < at < pi/2.
  [[nodiscard]] static Status check(const Edge& edge);

 private:
  void estimate(const Direction& omega_i, std::span<const Direction> omega_o, std::span<double> f_per_sr,
                std::span<Origin> origin) const noexcept final;
  [[nodiscard]] bool estimate_uncertainty(const Direction& omega_i, const Direction& omega_o,
                                          std::span<double> random_per_sr,
                                          std::span<double> systematic_per_sr) const noexcept final;
  /// distance > 0 [rad].
  [[nodiscard]] virtual double factor(double distance) const noexcept = 0;

  Edge edge_;
};

/// The nearest value inside.
class ClampExtrapolator final : public EdgeExtrapolator {
 public:
  /// Errors  kInvalidArgument: the edge is not between 0 and 90 deg.
  [[nodiscard]] static Result<std::shared_ptr<const ClampExtrapolator>> make(
      std::shared_ptr<const Brdf> inner, const Edge& edge);

 private:
  using EdgeExtrapolator::EdgeExtrapolator;
  [[nodiscard]] double factor(double) const noexcept override { return 1; }
};

/// From the nearest value inside to a share of it.
///
/// f = (1 - t) f_b + t p f_b with t = b(|omega - omega_b| / m, l), omega_b the nearest direction on the edge,
/// |.| the angle between them [rad], at most m.
/// Source  thesis 6.1.3, eq. 39, 40.
class GradientExtrapolator final : public EdgeExtrapolator {
 public:
  struct Options {
    double p = 0;            ///< Share at the end, >= 0.
    double m = radians(15);  ///< Where the end is reached [rad], > 0.
    double l = 0.5;          ///< Bend, 0..1; 0.5 is a straight line, above it stays high for longer.
  };
  /// Errors  kInvalidArgument: the edge or an option out of range.
  [[nodiscard]] static Result<std::shared_ptr<const GradientExtrapolator>> make(
      std::shared_ptr<const Brdf> inner, const Edge& edge, const Options& options);

  /// b(x, l): the quadratic Bezier curve with P0 = (0, 0), P1 = (l, 1 - l), P2 = (1, 1) at x in 0..1.
  [[nodiscard]] static double bend(double x, double l) noexcept;

 private:
  GradientExtrapolator(std::shared_ptr<const Brdf> inner, const Edge& edge, const Options& options)
      : EdgeExtrapolator(std::move(inner), edge), options_(options) {}
  [[nodiscard]] double factor(double distance) const noexcept override;

  Options options_;
};

}  // namespace scatter::reflectance
