#include "host_sdk/measurement/resampler.h"

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "host_sdk/measurement/local_fit.h"

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
[[gnu::target_clones("avx2", "default")]] void accumulate(const std::uint32_t* pixel, const float* weight,
                                                          std::size_t count, const float* value,
                                                          const float* variance, std::size_t lanes,
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
    : options_(options), pixels_(&pixels), descriptor_(descriptor), frame_(frame) {}

Resampler Resampler::build(const PixelGeometry& pixels, const protocol::Descriptor& descriptor,
                           const SampleFrame& frame, const Options& options) {
  Resampler r(pixels, descriptor, frame, options);
  const GridShape& grid = options.grid;
  r.rings_.resize(grid.theta_count);
  r.kinds_.assign(grid.nodes(), NodeKind::kEmpty);
  const protocol::Optics& optics = r.descriptor_.optics;

  oneapi::tbb::parallel_for(
      oneapi::tbb::blocked_range<std::size_t>(0, grid.theta_count, 1), [&](const auto& range) {
        const LocalFit fit(pixels, optics);
        FitWeights weights;
        for (std::size_t j = range.begin(); j != range.end(); ++j) {
          Ring& ring = r.rings_[j];
          ring.first.push_back(0);
          // All azimuths of the pole are one direction: solved once.
          const std::size_t solved = j == 0 ? 1 : grid.phi_count;
          for (std::size_t i = 0; i < solved; ++i) {
            const std::size_t node = j * grid.phi_count + i;
            const Direction w = frame.to_instrument(grid.direction(node));
            NodeKind kind = NodeKind::kSeen;
            for (const protocol::BlindSpot& spot : descriptor.blind_spots) {
              const Direction axis = reflectance::from_spherical(static_cast<double>(spot.theta_rad),
                                                                 static_cast<double>(spot.phi_rad));
              if (reflectance::angle_between(axis, w) < static_cast<double>(spot.radius_rad)) {
                kind = NodeKind::kBlind;
              }
            }
            const double theta = reflectance::theta_of(w);
            if (theta > static_cast<double>(optics.image_theta_max_rad)) {
              kind = NodeKind::kEmpty;
            } else if (kind == NodeKind::kSeen && theta > static_cast<double>(optics.theta_max_rad) + 1e-5) {
              kind = NodeKind::kOutside;
            }
            if (kind == NodeKind::kSeen || kind == NodeKind::kOutside) {
              const double radius = radius_for(fit, w, options.radius_rad);
              const double blur = blur_variance(options.source_radius_rad, fit.pixels_per_radian(w));
              if (fit.solve({w, radius, blur, 2}, {}, 1, 0, weights) &&
                  weights.noise_gain() < kLargestNoiseGain) {
                ring.pixel.insert(ring.pixel.end(), weights.pixel.begin(), weights.pixel.end());
                ring.weight.insert(ring.weight.end(), weights.weight.begin(), weights.weight.end());
              } else {
                kind = NodeKind::kEmpty;
              }
            }
            r.kinds_[node] = kind;
            ring.first.push_back(static_cast<std::uint32_t>(ring.pixel.size()));
          }
          if (j == 0) {
            std::fill_n(r.kinds_.begin(), grid.phi_count, r.kinds_[0]);
          }
        }
      });
  return r;
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
        const LocalFit fit(*pixels_, descriptor_.optics);
        FitWeights quadratic;
        FitWeights linear;
        const auto evaluate = [&](const FitWeights& w, std::size_t lane, float& mean, float& var) {
          mean = 0;
          var = 0;
          for (std::size_t k = 0; k < w.pixel.size(); ++k) {
            const std::size_t at = std::size_t{w.pixel[k]} * lanes + lane;
            mean += w.weight[k] * value[at];
            var += w.weight[k] * w.weight[k] * variance[at];
          }
        };
        for (std::size_t j = range.begin(); j != range.end(); ++j) {
          const Ring& ring = rings_[j];
          const std::size_t solved = j == 0 ? 1 : grid.phi_count;
          for (std::size_t i = 0; i < solved; ++i) {
            const std::size_t node = j * grid.phi_count + i;
            float* mean = out.value.data() + node * lanes;
            float* var = out.variance.data() + node * lanes;
            const Direction w = frame_.to_instrument(grid.direction(node));
            if (kinds_[node] == NodeKind::kBlind) {
              double reach = 0;
              for (const protocol::BlindSpot& spot : descriptor_.blind_spots) {
                const Direction axis = reflectance::from_spherical(static_cast<double>(spot.theta_rad),
                                                                   static_cast<double>(spot.phi_rad));
                const double distance = reflectance::angle_between(axis, w);
                if (distance < static_cast<double>(spot.radius_rad)) {
                  reach = std::max(reach, static_cast<double>(spot.radius_rad) + distance);
                }
              }
              for (std::size_t l = 0; l < lanes; ++l) {
                const double radius = radius_for(fit, w, reach + kFillMargin);
                if (fit.solve({w, radius, 0, 2}, variance, lanes, l, quadratic) &&
                    fit.solve({w, radius, 0, 1}, variance, lanes, l, linear)) {
                  evaluate(quadratic, l, mean[l], var[l]);
                  float flat = 0;
                  float unused = 0;
                  evaluate(linear, l, flat, unused);
                  out.fill_spread[node * lanes + l] = std::abs(flat - mean[l]);
                  out.pixels[node] = static_cast<float>(1.0 / quadratic.noise_gain());
                }
              }
              continue;
            }
            const std::uint32_t first = ring.first[i];
            const std::size_t count = ring.first[i + 1] - first;
            if (count == 0) {
              continue;
            }
            std::fill_n(var, lanes, 0.0F);
            accumulate(ring.pixel.data() + first, ring.weight.data() + first, count, value.data(),
                       variance.data(), lanes, mean, var);
            float gain = 0;
            for (std::size_t k = 0; k < count; ++k) {
              gain += ring.weight[first + k] * ring.weight[first + k];
            }
            out.pixels[node] = 1.0F / gain;
            for (std::size_t l = 0; l < lanes; ++l) {
              if (std::isfinite(var[l])) {
                continue;
              }
              // A saturated pixel in this lane: solve without it, unless the centre itself is lost.
              const double radius = radius_for(fit, w, options_.radius_rad);
              const double blur = blur_variance(options_.source_radius_rad, fit.pixels_per_radian(w));
              const SensorPoint at = project(descriptor_.optics, w);
              const auto centre =
                  static_cast<std::size_t>(at.y) * pixels_->width + static_cast<std::size_t>(at.x);
              const bool centre_lost =
                  pixels_->usable[centre] != 0 && std::isinf(variance[centre * lanes + l]);
              if (!centre_lost && fit.solve({w, radius, blur, 2}, variance, lanes, l, quadratic) &&
                  quadratic.noise_gain() < kLargestNoiseGain) {
                evaluate(quadratic, l, mean[l], var[l]);
              } else {
                mean[l] = 0;
                var[l] = kNoValue;
              }
            }
          }
          if (j == 0) {
            for (std::size_t i = 1; i < grid.phi_count; ++i) {
              std::copy_n(out.value.begin(), lanes,
                          out.value.begin() + static_cast<std::ptrdiff_t>(i * lanes));
              std::copy_n(out.variance.begin(), lanes,
                          out.variance.begin() + static_cast<std::ptrdiff_t>(i * lanes));
              std::copy_n(out.fill_spread.begin(), lanes,
                          out.fill_spread.begin() + static_cast<std::ptrdiff_t>(i * lanes));
              out.pixels[i] = out.pixels[0];
            }
          }
        }
      });
  return out;
}

}  // namespace scatter::measurement
