// Least-squares quadratic in the tangent plane of one direction: the kernel of the resampler.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "host_sdk/measurement/pixel_geometry.h"
#include "protocol/descriptor.h"

namespace scatter::measurement {

/// The functional that a fit computes: value at the centre minus blur_variance times the sum of the
/// pure second-order coefficients.
struct FitRequest {
  reflectance::Direction centre;  ///< Instrument frame.
  double radius_rad = 0;
  double blur_variance_rad2 = 0;
  int order = 2;   ///< 2 quadratic, 1 linear.
  int stride = 1;  ///< Uses every stride-th pixel of every stride-th row: wide fits need no more.
};

/// Pixels and weights h with value = sum h_p f_p.
struct FitWeights {
  std::vector<std::uint32_t> pixel;
  std::vector<float> weight;
  [[nodiscard]] double noise_gain() const noexcept;  ///< sum h^2.
};

/// Pixels usable for one fit; `lane_usable(p)` may exclude more (saturated ones).
class LocalFit {
 public:
  LocalFit(const PixelGeometry& pixels, const protocol::Optics& optics) noexcept
      : pixels_(&pixels), optics_(&optics) {}

  /// False: too few pixels for the order around the centre. `variance` with stride `lanes` starting
  /// at `lane` excludes pixels of infinite variance; empty = none excluded.
  [[nodiscard]] bool solve(const FitRequest& request, std::span<const float> variance, std::size_t lanes,
                           std::size_t lane, FitWeights& out) const;

  /// Pixels per radian at a direction, the smaller of radial and tangential scale.
  [[nodiscard]] double pixels_per_radian(const reflectance::Direction& w) const noexcept;

 private:
  const PixelGeometry* pixels_;
  const protocol::Optics* optics_;
};

}  // namespace scatter::measurement
