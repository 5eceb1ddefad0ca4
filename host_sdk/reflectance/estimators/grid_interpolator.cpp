#include "host_sdk/reflectance/estimators/grid_interpolator.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "host_sdk/reflectance/estimators/specular_nodes.h"
#include "host_sdk/reflectance/sampled_grid.h"
#include "host_sdk/reflectance/specular_grid_brdf.h"

namespace scatter::reflectance {
namespace {

using Grid = Result<std::shared_ptr<const Brdf>>;

Grid about_normal(const Brdf& inner, double step, const Extent& extent) {
  GridLayout layout;
  layout.incidences.clear();
  for (const double theta_i : extent.theta_i) {
    layout.incidences.push_back({0, theta_i, extent.azimuth.value_or(0)});
  }
  layout.theta_step = step;
  layout.phi_count = static_cast<std::size_t>(std::lround(2 * kPi / step));
  const double rows = std::min(extent.theta_o_to, kPi / 2) / step;
  layout.theta_count = static_cast<std::size_t>(std::floor(rows + 1e-6)) + 1;
  Result<GridBrdf> grid = sample_on_grid(inner, layout);
  if (!grid) {
    return std::unexpected(grid.error());
  }
  return std::make_shared<const GridBrdf>(std::move(*grid));
}

Grid about_specular(const Brdf& inner, double step, const Extent& extent) {
  SpecularGridBrdf::Content content;
  content.type = inner.type();
  content.wavelengths_nm.assign(inner.wavelengths_nm().begin(), inner.wavelengths_nm().end());
  content.rotation = {extent.azimuth.value_or(0)};
  content.theta_i = extent.theta_i;
  const auto turn = static_cast<std::size_t>(std::lround(2 * kPi / step));
  for (std::size_t k = 0; k <= turn; ++k) {
    content.azimuth.push_back(2 * kPi * static_cast<double>(k) / static_cast<double>(turn));
  }
  // The farthest known direction from any mirror direction.
  const double farthest = std::min(kPi, extent.theta_i.back() + extent.theta_o_to);
  for (std::size_t k = 0; static_cast<double>(k) * step < farthest + step - kSameAngle; ++k) {
    content.radial.push_back(std::min(kPi, static_cast<double>(k) * step));
  }
  const std::size_t n = inner.channels();
  const std::size_t per_incidence = content.azimuth.size() * content.radial.size();
  content.f_per_sr.resize(n);
  bool known = true;
  std::vector<std::vector<float>> sigma(n);
  for (const double theta_i : content.theta_i) {
    const double phi_i = content.rotation.front();
    const std::vector<Direction> nodes = specular_nodes(content, theta_i, phi_i);
    const Direction omega_i = from_spherical(theta_i, phi_i);
    std::vector<double> f(per_incidence * n);
    std::vector<Origin> origin(per_incidence);
    inner.eval_batch(omega_i, nodes, f, origin);
    std::vector<double> random(n);
    std::vector<double> systematic(n);
    for (std::size_t k = 0; k < per_incidence; ++k) {
      const bool valid = origin[k] != Origin::kInvalid;
      known = known && (!valid || inner.uncertainty(omega_i, nodes[k], random, systematic));
      for (std::size_t c = 0; c < n; ++c) {
        content.f_per_sr[c].push_back(static_cast<float>(f[k * n + c]));
        sigma[c].push_back(valid && known ? static_cast<float>(std::hypot(random[c], systematic[c])) : 0.0F);
      }
    }
    content.origin.insert(content.origin.end(), origin.begin(), origin.end());
  }
  if (known) {
    content.sigma_per_sr = std::move(sigma);
  }
  Result<SpecularGridBrdf> grid = SpecularGridBrdf::make(std::move(content));
  if (!grid) {
    return std::unexpected(grid.error());
  }
  return std::make_shared<const SpecularGridBrdf>(std::move(*grid));
}

}  // namespace

Result<std::shared_ptr<const GridInterpolator>> GridInterpolator::make(std::shared_ptr<const Brdf> inner,
                                                                       const Options& options,
                                                                       const Extent& extent) {
  const double turns = 2 * kPi / options.step;
  if (!(options.step >= radians(0.1) - kSameAngle && options.step <= radians(30) + kSameAngle) ||
      std::abs(turns - std::round(turns)) > 1e-6) {
    return fail(ErrorCode::kInvalidArgument,
                fmt::format("grid: the step is {} deg, expected 0.1..30 deg and 360 a multiple of it",
                            degrees(options.step)),
                "give a step such as 1");
  }
  if (extent.theta_i.empty()) {
    return fail(ErrorCode::kFailedPrecondition, "grid: the data names no incidences to build grids at",
                "use it on measured data, or sample the model onto a grid");
  }
  const Grid grid = options.axis == GridAxis::kUp ? about_normal(*inner, options.step, extent)
                                                  : about_specular(*inner, options.step, extent);
  if (!grid) {
    return std::unexpected(grid.error());
  }
  const AngularRegion region{.theta_i_from = extent.theta_i.front(),
                             .theta_i_to = extent.theta_i.back(),
                             .theta_o_from = 0,
                             .theta_o_to = extent.theta_o_to};
  return std::shared_ptr<const GridInterpolator>(new GridInterpolator(std::move(inner), *grid, region));
}

Result<std::shared_ptr<const GridInterpolator>> GridInterpolator::make(std::shared_ptr<const Brdf> inner,
                                                                       const Options& options) {
  const Extent extent = extent_of(*inner);
  return make(std::move(inner), options, extent);
}

GridInterpolator::GridInterpolator(std::shared_ptr<const Brdf> inner, std::shared_ptr<const Brdf> grid,
                                   const AngularRegion& region)
    : Estimator(std::move(inner), region), grid_(std::move(grid)) {}

}  // namespace scatter::reflectance
