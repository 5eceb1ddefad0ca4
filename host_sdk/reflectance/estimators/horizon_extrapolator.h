// Between the last measured theta_o and the horizon: the four modes of the commercial instrument's software.
#pragma once

#include <memory>
#include <string_view>

#include "host_sdk/error/error.h"
#include "host_sdk/reflectance/estimators/edge.h"

namespace scatter::reflectance {

enum class HorizonMode : std::uint8_t {
  kNone,      ///< No value: 0 and kInvalid.
  kLinear,    ///< Straight down from the edge's value to 0 at 90 deg.
  kConstant,  ///< The edge's value.
  kBezier,    ///< Goes on with the slope at the edge and comes down to 0 at 90 deg.
};
/// "none", "linear", "constant", "bezier".
[[nodiscard]] std::string_view name(HorizonMode mode) noexcept;

/// At the same light and the same azimuth.
///
/// Bezier    quadratic, from the edge to (90 deg, 0); the middle point lies on the edge's tangent half-way to
///           the horizon, or where the tangent meets 0 if that comes first, so that no value is negative
///           where the edge's is not. The slope is that over the last degree inside.
/// Origin    kExtrapolated; kInvalid where the edge (for kBezier also one degree inside) has no value.
/// Uncertainty  the edge's relative one is kept (absolute where its value is not positive); how far
///           the surface departs from the assumption is not known and not in it.
class HorizonExtrapolator final : public Estimator {
 public:
  /// from: last measured theta_o [rad].
  /// Errors  kInvalidArgument: not 1 deg < from < 90 deg.
  [[nodiscard]] static Result<std::shared_ptr<const HorizonExtrapolator>> make(
      std::shared_ptr<const Brdf> inner, HorizonMode mode, double from);

  [[nodiscard]] HorizonMode mode() const noexcept { return mode_; }
  [[nodiscard]] double from() const noexcept { return from_; }

 private:
  HorizonExtrapolator(std::shared_ptr<const Brdf> inner, HorizonMode mode, double from);
  void estimate(const Direction& omega_i, std::span<const Direction> omega_o, std::span<double> f_per_sr,
                std::span<Origin> origin) const noexcept override;
  [[nodiscard]] bool estimate_uncertainty(const Direction& omega_i, const Direction& omega_o,
                                          std::span<double> random_per_sr,
                                          std::span<double> systematic_per_sr) const noexcept override;
  /// Inner values where the azimuths of omega_o meet one theta_o.
  void values_on(double theta_o, const Direction& omega_i, std::span<const Direction> omega_o,
                 std::span<double> f_per_sr, std::span<Origin> origin) const noexcept;
  /// 0 at the edge, 1 at the horizon.
  [[nodiscard]] double progress(const Direction& omega_o) const noexcept;

  HorizonMode mode_;
  double from_;
};

}  // namespace scatter::reflectance
