// Samples made ready for least squares: geometry, transformed values and weights, computed once.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "host_sdk/reflectance/fitting/fit.h"
#include "host_sdk/reflectance/models/formulas/geometry.h"

namespace scatter::reflectance {

/// Parameters of a family: those of FittedBrdf.
struct FitPoint {
  std::vector<double> shape = {};
  std::vector<double> coefficient = {};  ///< [channel * terms + term]
};

/// Planes are per channel: value of sample k and channel c at [c * size() + k].
struct FitData {
  std::size_t channels = 0;
  Residual residual = Residual::kLog;
  std::vector<FitSamples::Incidence> incidences = {};
  std::vector<formulas::Geometry> geometry = {};  ///< One per sample.
  std::vector<double> solid_angle_sr = {};        ///< One per sample.
  std::vector<double> root_weight = {};           ///< One per sample; mean of the squares is 1.
  std::vector<double> floor = {};                 ///< e of Residual::kLog, one per channel [1/sr].
  std::vector<double> f_per_sr = {};              ///< Plane per channel.
  std::vector<double> target = {};                ///< Plane per channel: transformed f.
  std::vector<double> inverse_sigma = {};         ///< Plane per channel; kUncertainty only.

  [[nodiscard]] std::size_t size() const noexcept { return geometry.size(); }
};

/// The e of Residual for every channel: a thousandth of the median of the positive f c, or twice
/// the median uncertainty of f c where that is more.
[[nodiscard]] std::vector<double> residual_floor(const FitSamples& samples);

/// Values transformed; weights by `weighting`, the flux taken from the samples.
[[nodiscard]] FitData make_fit_data(const FitSamples& samples, Residual residual, Weighting weighting,
                                    std::span<const double> floor);

/// Replaces the samples' flux in the weights by that of a model, whose values do not share the
/// samples' noise. Nothing to do for other weightings.
void weigh_by_model(FitData& data, Weighting weighting, const FitFamily& family, const FitPoint& point);

/// The curve that residuals are differences of, and its slope by the value.
///
/// Takes c * v + e, the floored cosine-weighted value (kUncertainty does not use them).
[[nodiscard]] double transformed(Residual residual, double floored) noexcept;
[[nodiscard]] double transformed_slope(Residual residual, double floored) noexcept;

/// rms_residual of a point, weighted as the data say.
[[nodiscard]] double rms_residual(const FitData& data, const FitFamily& family, const FitPoint& point);

}  // namespace scatter::reflectance
