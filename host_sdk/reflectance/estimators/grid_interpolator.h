// A grid per incidence, filled once from another link and then read linearly.
#pragma once

#include <memory>
#include <vector>

#include "host_sdk/error/error.h"
#include "host_sdk/reflectance/estimators/estimator.h"
#include "host_sdk/reflectance/estimators/extent.h"

namespace scatter::reflectance {

/// About which direction the grid's angles count.
enum class GridAxis : std::uint8_t {
  kUp,        ///< The normal: a GridBrdf.
  kSpecular,  ///< The mirror (or straight) direction: a SpecularGridBrdf.
};

/// Evaluates the inner link at the nodes of a grid when it is made, and answers from the grid: bilinear in
/// the angles, linear between incidences at the same angles about the mirror direction. What is slow to ask
/// (a search among scattered samples) is asked once per node.
///
/// Origin    as GridBrdf / SpecularGridBrdf, from the nodes' origins; worse of the nodes in use.
/// Range     incidences of `extent` and theta_o up to its end; elsewhere the inner link answers.
/// Memory    4 bytes per node and channel, 12 with uncertainties, and the grid's own tables.
class GridInterpolator final : public Estimator {
 public:
  struct Options {
    GridAxis axis = GridAxis::kUp;
    double step = radians(1);  ///< Of both angles [rad]; 360 deg must be a multiple of it; 0.1..30 deg.
  };
  /// Errors  kFailedPrecondition: no incidences; kInvalidArgument: step.
  [[nodiscard]] static Result<std::shared_ptr<const GridInterpolator>> make(std::shared_ptr<const Brdf> inner,
                                                                            const Options& options,
                                                                            const Extent& extent);
  /// Extent as extent_of(*inner) finds it.
  [[nodiscard]] static Result<std::shared_ptr<const GridInterpolator>> make(std::shared_ptr<const Brdf> inner,
                                                                            const Options& options);

  /// The GridBrdf or SpecularGridBrdf itself.
  [[nodiscard]] const Brdf& grid() const noexcept { return *grid_; }

 private:
  GridInterpolator(std::shared_ptr<const Brdf> inner, std::shared_ptr<const Brdf> grid,
                   const AngularRegion& region);
  void estimate(const Direction& omega_i, std::span<const Direction> omega_o, std::span<double> f_per_sr,
                std::span<Origin> origin) const noexcept override {
    grid_->eval_batch(omega_i, omega_o, f_per_sr, origin);
  }
  [[nodiscard]] bool estimate_uncertainty(const Direction& omega_i, const Direction& omega_o,
                                          std::span<double> random_per_sr,
                                          std::span<double> systematic_per_sr) const noexcept override {
    return grid_->uncertainty(omega_i, omega_o, random_per_sr, systematic_per_sr);
  }

  std::shared_ptr<const Brdf> grid_;
};

}  // namespace scatter::reflectance
