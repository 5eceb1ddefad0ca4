#include "host_sdk/reflectance/estimators/neighbors_interpolator.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "host_sdk/reflectance/estimators/scratch.h"

namespace scatter::reflectance {
namespace {

constexpr std::size_t kMostNeighbors = 1024;
/// As ScatteredBrdf::eval.
constexpr float kSamePlaceSquared = 1e-12F;

}  // namespace

Result<std::shared_ptr<const NeighborsInterpolator>> NeighborsInterpolator::make(
    std::shared_ptr<const ScatteredBrdf> samples, const Options& options) {
  if (options.k < 1 || options.k > kMostNeighbors || options.k_min < 1 || options.k_min > options.k ||
      !(options.d_max > 0) || !(options.epsilon > 0)) {
    return fail(ErrorCode::kInvalidArgument,
                fmt::format("neighbors: k {}, k_min {}, d_max {}, epsilon {}; expected k in 1..{}, k_min in "
                            "1..k, d_max > 0, epsilon > 0",
                            options.k, options.k_min, options.d_max, options.epsilon, kMostNeighbors),
                "correct the option");
  }
  return std::shared_ptr<const NeighborsInterpolator>(new NeighborsInterpolator(std::move(samples), options));
}

NeighborsInterpolator::NeighborsInterpolator(std::shared_ptr<const ScatteredBrdf> samples,
                                             const Options& options)
    : Estimator(samples, options.region), samples_(std::move(samples)), options_(options) {}

std::size_t NeighborsInterpolator::weigh(std::span<const search::Neighbor> found,
                                         std::span<double> weight) const noexcept {
  const double most = options_.d_max * options_.d_max;
  std::size_t count = 0;
  double total = 0;
  for (; count < found.size() && static_cast<double>(found[count].distance_squared) <= most; ++count) {
    const double d = std::sqrt(static_cast<double>(found[count].distance_squared)) + options_.epsilon;
    weight[count] = 1 / (d * d);
    total += weight[count];
  }
  if (count > 0 && found[0].distance_squared <= kSamePlaceSquared) {
    weight[0] = 1;
    return 1;
  }
  if (count < options_.k_min) {
    return 0;
  }
  for (double& w : weight.first(count)) {
    w /= total;
  }
  return count;
}

void NeighborsInterpolator::estimate(const Direction& omega_i, std::span<const Direction> omega_o,
                                     std::span<double> f_per_sr, std::span<Origin> origin) const noexcept {
  const std::size_t n = channels();
  const std::size_t k_most = options_.k;
  Scratch scratch;
  const std::span<search::Point> queries = scratch.take<search::Point>(omega_o.size());
  const std::span<search::Neighbor> found = scratch.take<search::Neighbor>(omega_o.size() * k_most);
  const std::span<double> weight = scratch.take<double>(k_most);
  for (std::size_t q = 0; q < omega_o.size(); ++q) {
    const ScatteredBrdf::Pair at = samples_->turned(omega_i, omega_o[q]);
    queries[q] = search::point_of(at.omega_i, at.omega_o);
  }
  // Sizes fit by construction, the only thing that this can complain about.
  (void)samples_->index().nearest_batch(queries, k_most, found);
  std::ranges::fill(f_per_sr, 0.0);
  for (std::size_t q = 0; q < omega_o.size(); ++q) {
    const std::span<const search::Neighbor> near = found.subspan(q * k_most, k_most);
    const std::size_t count = weigh(near, weight);
    if (count == 0) {
      origin[q] = Origin::kInvalid;
      continue;
    }
    const bool at_site = near[0].distance_squared <= kSamePlaceSquared;
    origin[q] = at_site ? Origin::kMeasured : Origin::kInterpolated;
    for (std::size_t k = 0; k < count; ++k) {
      origin[q] = combined(origin[q], samples_->sites()[near[k].id].origin);
      const std::span<const float> value = samples_->value(near[k].id);
      for (std::size_t c = 0; c < n; ++c) {
        f_per_sr[q * n + c] += weight[k] * static_cast<double>(value[c]);
      }
    }
  }
}

bool NeighborsInterpolator::estimate_uncertainty(const Direction& omega_i, const Direction& omega_o,
                                                 std::span<double> random_per_sr,
                                                 std::span<double> systematic_per_sr) const noexcept {
  if (!samples_->has_uncertainty()) {
    return false;
  }
  Scratch scratch;
  const std::span<search::Neighbor> found = scratch.take<search::Neighbor>(options_.k);
  const std::span<double> weight = scratch.take<double>(options_.k);
  const ScatteredBrdf::Pair at = samples_->turned(omega_i, omega_o);
  const std::size_t near = samples_->index().nearest(search::point_of(at.omega_i, at.omega_o), found);
  const std::size_t count = weigh(found.first(near), weight);
  if (count == 0) {
    return false;
  }
  std::ranges::fill(random_per_sr, 0.0);
  std::ranges::fill(systematic_per_sr, 0.0);
  for (std::size_t k = 0; k < count; ++k) {
    for (std::size_t c = 0; c < channels(); ++c) {
      random_per_sr[c] += weight[k] * static_cast<double>(samples_->random(found[k].id)[c]);
      systematic_per_sr[c] += weight[k] * static_cast<double>(samples_->systematic(found[k].id)[c]);
    }
  }
  return true;
}

}  // namespace scatter::reflectance
