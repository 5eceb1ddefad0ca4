// One link of a chain of estimators: answers in its own region, passes on everything else.
#pragma once

#include <memory>
#include <span>

#include "host_sdk/reflectance/brdf.h"

namespace scatter::reflectance {

/// Where a link answers: a rectangle of polar angles [rad], ends included.
///
/// theta_o counts from the normal of the side that light leaves from, 0..pi/2 for BTDF too.
struct AngularRegion {
  double theta_i_from = 0;
  double theta_i_to = kPi / 2;
  double theta_o_from = 0;
  double theta_o_to = kPi / 2;
};

/// Two angles closer than this are the same one [rad]; far below any instrument's geometry.
inline constexpr double kSameAngle = 1e-6;

/// Angle from the normal of the exit side [rad], 0..pi/2; a rounding error past it is pi/2.
[[nodiscard]] double exit_theta(ScatterType type, const Direction& omega_o) noexcept;

/// A `Brdf` that wraps another one.
///
/// Quantity  f [1/sr] as its inner link: interpolated, extrapolated or corrected where the link
///           owns the geometry, untouched elsewhere.
/// Range     omega_i.z > 0 and omega_o on its side (the horizon itself included). Anything else,
///           with vectors that are no directions (zero, NaN, length not within 1e-3 of 1), gives 0
///           and kInvalid.
/// Threads   all const functions from any thread.
/// Cost      a batch goes through the chain as a batch: each link splits it by owner, so that a link
///           costs what its own points cost plus about 2 ns a point.
class Estimator : public Brdf {
 public:
  [[nodiscard]] const AngularRegion& region() const noexcept { return region_; }
  [[nodiscard]] const Brdf& inner() const noexcept { return *inner_; }

  [[nodiscard]] ScatterType type() const noexcept override { return inner_->type(); }
  [[nodiscard]] std::size_t channels() const noexcept override { return inner_->channels(); }
  [[nodiscard]] std::span<const float> wavelengths_nm() const noexcept override {
    return inner_->wavelengths_nm();
  }
  [[nodiscard]] Origin eval(const Direction& omega_i, const Direction& omega_o,
                            std::span<double> f_per_sr) const noexcept final;
  [[nodiscard]] bool uncertainty(const Direction& omega_i, const Direction& omega_o,
                                 std::span<double> random_per_sr,
                                 std::span<double> systematic_per_sr) const noexcept final;
  [[nodiscard]] bool dirac(const Direction& omega_i, std::span<double> weight) const noexcept override {
    return inner_->dirac(omega_i, weight);
  }
  void eval_batch(const Direction& omega_i, std::span<const Direction> omega_o, std::span<double> f_per_sr,
                  std::span<Origin> origin) const noexcept final;

 protected:
  /// inner must not be null.
  Estimator(std::shared_ptr<const Brdf> inner, const AngularRegion& region);

  /// Values at geometries of the region; all directions are valid and on their sides.
  /// Shape     f_per_sr[k * channels() + c], origin[k]; at most kBatch of them.
  /// Must      give 0 where it gives kInvalid, and the same numbers however the points are split up.
  virtual void estimate(const Direction& omega_i, std::span<const Direction> omega_o,
                        std::span<double> f_per_sr, std::span<Origin> origin) const noexcept = 0;
  /// Standard uncertainties at one geometry of the region; as Brdf::uncertainty.
  [[nodiscard]] virtual bool estimate_uncertainty(const Direction& omega_i, const Direction& omega_o,
                                                  std::span<double> random_per_sr,
                                                  std::span<double> systematic_per_sr) const noexcept = 0;

  /// Largest number of points that `estimate` is given at once.
  static constexpr std::size_t kBatch = 1024;

 private:
  enum class Owner : std::uint8_t { kNobody, kThis, kInner };
  /// Bounds of the region as seen from one incidence; cosines, so that no point needs an angle.
  struct Bounds {
    double lowest = 0;   ///< Of omega_o.z towards the exit side.
    double highest = 0;  ///< Likewise.
    bool here = false;   ///< theta_i lies in the region.
    bool valid = false;  ///< omega_i is a direction above the surface.
  };
  [[nodiscard]] Bounds bounds(const Direction& omega_i) const noexcept;
  [[nodiscard]] Owner owner(const Bounds& bounds, const Direction& omega_o) const noexcept;
  void split(const Bounds& bounds, const Direction& omega_i, std::span<const Direction> omega_o,
             std::span<double> f_per_sr, std::span<Origin> origin) const noexcept;

  std::shared_ptr<const Brdf> inner_;
  AngularRegion region_;
  double side_ = 1;     ///< +1 for BRDF, -1 for BTDF.
  double lowest_ = -1;  ///< cos(theta_o_to), widened by kSameAngle.
  double highest_ = 2;  ///< cos(theta_o_from), likewise.
};

}  // namespace scatter::reflectance
