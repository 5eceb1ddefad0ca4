#include "host_sdk/measurement/resampler.h"

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "host_sdk/measurement/local_fit.h"
#include "host_sdk/simd/vector_clones.h"

namespace scatter::measurement {

using reflectance::Direction;

namespace {

constexpr float kNoValue = std::numeric_limits<float>::infinity();

// A node whose fit multiplies the noise of one pixel by more than this is not a measurement of it.
constexpr double kLargestNoiseGain = 1.0;

// Blind discs are filled by a fit that reaches this far beyond their rim [rad].
constexpr double kFillMargin = 2.0 * reflectance::kPi / 180.0;

double radius_for(const LocalFit& fit, const Direction& w, double wanted) noexcept {
  return std::max(wanted, 2.5 / fit.pixels_per_radian(w));
}

/// Per-axis variance of the blur: uniform disc of the source plus one square pixel.
double blur_variance(double source_radius, double pixels_per_radian) noexcept {
  return source_radius * source_radius / 4.0 + 1.0 / (12.0 * pixels_per_radian * pixels_per_radian);
}

// acc[l] += sum h f, var[l] += sum h^2 v over one row of the operator.
SCATTER_VECTOR_CLONES void accumulate(const std::uint32_t* pixel, const float* weight, std::size_t count,
                                      const float* value, const float* variance, std::size_t lanes,
                                      float* acc, float* var) {
  for (std::size_t k = 0; k < count; ++k) {
    const float h = weight[k];
    const float hh = h * h;
    const float* f = value + std::size_t{pixel[k]} * lanes;
    const float* v = variance + std::size_t{pixel[k]} * lanes;
    for (std::size_t l = 0; l < lanes; ++l) {
      acc[l] += h * f[l];
      var[l] += hh * v[l];
    }
  }
}

}  // namespace

Resampler::Resampler(const PixelGeometry& pixels, const protocol::Descriptor& descriptor,
                     const SampleFrame& frame, const Options& options)
    : options_(options), pixels_(&pixels), descriptor_(descriptor), frame_(frame) {
  for (const protocol::BlindSpot& spot : descriptor_.blind_spots) {
    const auto radius = static_cast<double>(spot.radius_rad);
    blind_.push_back(
        {reflectance::from_spherical(static_cast<double>(spot.theta_rad), static_cast<double>(spot.phi_rad)),
         radius, std::cos(radius)});
  }
}

void Resampler::Rows::append(const FitWeights& weights) {
  pixel.insert(pixel.end(), weights.pixel.begin(), weights.pixel.end());
  weight.insert(weight.end(), weights.weight.begin(), weights.weight.end());
  append_empty();
}

Resampler::Footprint Resampler::footprint(const Direction& w) const {
  const protocol::Optics& optics = descriptor_.optics;
  const LocalFit fit(*pixels_, optics);
  const double theta = reflectance::theta_of(w);
  if (theta > static_cast<double>(optics.image_theta_max_rad)) {
    return {};
  }
  double reach = 0;
  for (const BlindDisc& disc : blind_) {
    if (dot(disc.axis, w) > disc.cos_radius) {
      reach = std::max(reach, disc.radius + reflectance::angle_between(disc.axis, w));
    }
  }
  if (reach > 0) {
    return {NodeKind::kBlind, radius_for(fit, w, reach + kFillMargin), 0, 2};
  }
  const bool inside = theta <= static_cast<double>(optics.theta_max_rad) + 1e-5;
  return {inside ? NodeKind::kSeen : NodeKind::kOutside, radius_for(fit, w, options_.radius_rad),
          blur_variance(options_.source_radius_rad, fit.pixels_per_radian(w)), 1};
}

Resampler Resampler::build(const PixelGeometry& pixels, const protocol::Descriptor& descriptor,
                           const SampleFrame& frame, const Options& options) {
  Resampler r(pixels, descriptor, frame, options);
  const GridShape& grid = options.grid;
  r.rings_.resize(grid.theta_count);
  r.kinds_.assign(grid.nodes(), NodeKind::kEmpty);

  oneapi::tbb::parallel_for(
      oneapi::tbb::blocked_range<std::size_t>(0, grid.theta_count, 1), [&](const auto& range) {
        const LocalFit fit(pixels, r.descriptor_.optics);
        FitWeights best;
        FitWeights flat;
        for (std::size_t j = range.begin(); j != range.end(); ++j) {
          Ring& ring = r.rings_[j];
          ring.best.append_empty();
          ring.flat.append_empty();
          // All azimuths of the pole are one direction: solved once.
          const std::size_t solved = j == 0 ? 1 : grid.phi_count;
          for (std::size_t i = 0; i < solved; ++i) {
            const Direction w = frame.to_instrument(grid.direction(j * grid.phi_count + i));
            Footprint place = r.footprint(w);
            const bool blind = place.kind == NodeKind::kBlind;
            bool good =
                place.radius_rad > 0 &&
                fit.solve({w, place.radius_rad, place.blur_variance_rad2, 2, place.stride}, {}, 1, 0, best) &&
                best.noise_gain() < kLargestNoiseGain;
            if (good && blind) {
              good = fit.solve({w, place.radius_rad, 0, 1, place.stride}, {}, 1, 0, flat);
            }
            if (good) {
              ring.best.append(best);
            } else {
              ring.best.append_empty();
              place.kind = NodeKind::kEmpty;
            }
            if (good && blind) {
              ring.flat.append(flat);
            } else {
              ring.flat.append_empty();
            }
            r.kinds_[j * grid.phi_count + i] = place.kind;
          }
          if (j == 0) {
            std::fill_n(r.kinds_.begin(), grid.phi_count, r.kinds_[0]);
          }
        }
      });
  return r;
}

void Resampler::solve_again(const Direction& w, std::span<const float> value, std::span<const float> variance,
                            std::size_t lanes, std::size_t lane, float& mean, float& var) const {
  mean = 0;
  var = kNoValue;
  // A node whose own pixel is lost has no value; one near lost pixels is fitted without them.
  const SensorPoint at = project(descriptor_.optics, w);
  const auto centre = static_cast<std::size_t>(at.y) * pixels_->width + static_cast<std::size_t>(at.x);
  if (centre >= pixels_->usable.size() ||
      (pixels_->usable[centre] != 0 && std::isinf(variance[centre * lanes + lane]))) {
    return;
  }
  const Footprint place = footprint(w);
  const LocalFit fit(*pixels_, descriptor_.optics);
  FitWeights weights;
  if (!fit.solve({w, place.radius_rad, place.blur_variance_rad2, 2, place.stride}, variance, lanes, lane,
                 weights) ||
      weights.noise_gain() >= kLargestNoiseGain) {
    return;
  }
  var = 0;
  for (std::size_t k = 0; k < weights.pixel.size(); ++k) {
    const std::size_t p = std::size_t{weights.pixel[k]} * lanes + lane;
    mean += weights.weight[k] * value[p];
    var += weights.weight[k] * weights.weight[k] * variance[p];
  }
}

NodeValues Resampler::apply(std::span<const float> value, std::span<const float> variance,
                            std::size_t lanes) const {
  const GridShape& grid = options_.grid;
  NodeValues out;
  out.lanes = lanes;
  out.value.assign(grid.nodes() * lanes, 0.0F);
  out.variance.assign(grid.nodes() * lanes, kNoValue);
  out.pixels.assign(grid.nodes(), 0.0F);
  out.fill_spread.assign(grid.nodes() * lanes, 0.0F);
  out.kind = kinds_;

  oneapi::tbb::parallel_for(
      oneapi::tbb::blocked_range<std::size_t>(0, grid.theta_count, 1), [&](const auto& range) {
        std::vector<float> flat(lanes);
        std::vector<float> unused(lanes);
        for (std::size_t j = range.begin(); j != range.end(); ++j) {
          const Ring& ring = rings_[j];
          const std::size_t solved = j == 0 ? 1 : grid.phi_count;
          for (std::size_t i = 0; i < solved; ++i) {
            const std::size_t node = j * grid.phi_count + i;
            const std::uint32_t first = ring.best.first[i];
            const std::size_t count = ring.best.first[i + 1] - first;
            if (count == 0) {
              continue;
            }
            float* mean = out.value.data() + node * lanes;
            float* var = out.variance.data() + node * lanes;
            std::fill_n(var, lanes, 0.0F);
            accumulate(ring.best.pixel.data() + first, ring.best.weight.data() + first, count, value.data(),
                       variance.data(), lanes, mean, var);
            float gain = 0;
            for (std::size_t k = 0; k < count; ++k) {
              gain += ring.best.weight[first + k] * ring.best.weight[first + k];
            }
            out.pixels[node] = 1.0F / gain;
            for (std::size_t l = 0; l < lanes; ++l) {
              if (!std::isfinite(var[l])) {
                solve_again(frame_.to_instrument(grid.direction(node)), value, variance, lanes, l, mean[l],
                            var[l]);
              }
            }
            const std::uint32_t flat_first = ring.flat.first[i];
            const std::size_t flat_count = ring.flat.first[i + 1] - flat_first;
            if (flat_count > 0) {
              std::ranges::fill(flat, 0.0F);
              accumulate(ring.flat.pixel.data() + flat_first, ring.flat.weight.data() + flat_first,
                         flat_count, value.data(), variance.data(), lanes, flat.data(), unused.data());
              for (std::size_t l = 0; l < lanes; ++l) {
                out.fill_spread[node * lanes + l] = std::abs(flat[l] - mean[l]);
              }
            }
          }
          if (j == 0) {
            for (std::size_t i = 1; i < grid.phi_count; ++i) {
              for (std::vector<float>* plane : {&out.value, &out.variance, &out.fill_spread}) {
                std::copy_n(plane->begin(), lanes, plane->begin() + static_cast<std::ptrdiff_t>(i * lanes));
              }
              out.pixels[i] = out.pixels[0];
            }
          }
        }
      });
  return out;
}

}  // namespace scatter::measurement
