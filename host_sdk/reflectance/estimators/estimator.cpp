#include "host_sdk/reflectance/estimators/estimator.h"

#include <algorithm>
#include <cmath>

#include "host_sdk/reflectance/estimators/scratch.h"

namespace scatter::reflectance {
namespace {

/// Bounds of the squared length of a direction: float rounding passes, a forgotten normalisation does not.
constexpr double kLeastSquare = 0.998;
constexpr double kLargestSquare = 1.002;

bool is_direction(const Direction& w) noexcept {
  const double square = dot(w, w);
  return square > kLeastSquare && square < kLargestSquare;
}

}  // namespace

double exit_theta(ScatterType type, const Direction& omega_o) noexcept {
  const double up = type == ScatterType::kBrdf ? omega_o.z : -omega_o.z;
  return std::atan2(std::hypot(omega_o.x, omega_o.y), std::max(up, 0.0));
}

Estimator::Estimator(std::shared_ptr<const Brdf> inner, const AngularRegion& region)
    : inner_(std::move(inner)), region_(region), side_(inner_->type() == ScatterType::kBrdf ? 1 : -1) {
  if (region_.theta_o_to < kPi / 2) {
    lowest_ = std::cos(region_.theta_o_to + kSameAngle);
  }
  if (region_.theta_o_from > kSameAngle) {
    highest_ = std::cos(region_.theta_o_from - kSameAngle);
  }
}

Estimator::Bounds Estimator::bounds(const Direction& omega_i) const noexcept {
  Bounds found{lowest_, highest_, false, is_direction(omega_i) && omega_i.z > 0};
  if (found.valid) {
    const double theta_i = theta_of(omega_i);
    found.here = theta_i >= region_.theta_i_from - kSameAngle && theta_i <= region_.theta_i_to + kSameAngle;
  }
  return found;
}

Estimator::Owner Estimator::owner(const Bounds& bounds, const Direction& omega_o) const noexcept {
  const double up = side_ * omega_o.z;
  if (!bounds.valid || !is_direction(omega_o) || !(up >= -kSameAngle)) {
    return Owner::kNobody;
  }
  return bounds.here && up >= bounds.lowest && up <= bounds.highest ? Owner::kThis : Owner::kInner;
}

Origin Estimator::eval(const Direction& omega_i, const Direction& omega_o,
                       std::span<double> f_per_sr) const noexcept {
  switch (owner(bounds(omega_i), omega_o)) {
    case Owner::kThis: {
      Origin origin = Origin::kInvalid;
      estimate(omega_i, std::span(&omega_o, 1), f_per_sr, std::span(&origin, 1));
      return origin;
    }
    case Owner::kInner:
      return inner_->eval(omega_i, omega_o, f_per_sr);
    case Owner::kNobody:
      break;
  }
  std::ranges::fill(f_per_sr, 0.0);
  return Origin::kInvalid;
}

bool Estimator::uncertainty(const Direction& omega_i, const Direction& omega_o,
                            std::span<double> random_per_sr,
                            std::span<double> systematic_per_sr) const noexcept {
  switch (owner(bounds(omega_i), omega_o)) {
    case Owner::kThis:
      return estimate_uncertainty(omega_i, omega_o, random_per_sr, systematic_per_sr);
    case Owner::kInner:
      return inner_->uncertainty(omega_i, omega_o, random_per_sr, systematic_per_sr);
    case Owner::kNobody:
      break;
  }
  return false;
}

void Estimator::eval_batch(const Direction& omega_i, std::span<const Direction> omega_o,
                           std::span<double> f_per_sr, std::span<Origin> origin) const noexcept {
  const Bounds seen = bounds(omega_i);
  if (!seen.valid) {
    std::ranges::fill(f_per_sr, 0.0);
    std::ranges::fill(origin, Origin::kInvalid);
    return;
  }
  const std::size_t n = channels();
  Scratch scratch;
  const std::span<Origin> unwanted = scratch.take<Origin>(origin.empty() ? kBatch : 0);
  for (std::size_t at = 0; at < omega_o.size(); at += kBatch) {
    const std::size_t count = std::min(kBatch, omega_o.size() - at);
    split(seen, omega_i, omega_o.subspan(at, count), f_per_sr.subspan(at * n, count * n),
          origin.empty() ? unwanted.first(count) : origin.subspan(at, count));
  }
}

void Estimator::split(const Bounds& bounds, const Direction& omega_i, std::span<const Direction> omega_o,
                      std::span<double> f_per_sr, std::span<Origin> origin) const noexcept {
  const std::size_t n = channels();
  Scratch scratch;
  const std::span<Owner> owners = scratch.take<Owner>(omega_o.size());
  std::size_t ours = 0;
  std::size_t theirs = 0;
  for (std::size_t k = 0; k < omega_o.size(); ++k) {
    owners[k] = owner(bounds, omega_o[k]);
    ours += owners[k] == Owner::kThis ? 1U : 0U;
    theirs += owners[k] == Owner::kInner ? 1U : 0U;
  }
  if (ours == omega_o.size()) {
    estimate(omega_i, omega_o, f_per_sr, origin);
    return;
  }
  if (theirs == omega_o.size()) {
    inner_->eval_batch(omega_i, omega_o, f_per_sr, origin);
    return;
  }
  std::ranges::fill(f_per_sr, 0.0);
  std::ranges::fill(origin, Origin::kInvalid);
  const std::size_t most = std::max(ours, theirs);
  const std::span<Direction> directions = scratch.take<Direction>(most);
  const std::span<double> values = scratch.take<double>(most * n);
  const std::span<Origin> origins = scratch.take<Origin>(most);
  for (const Owner who : {Owner::kThis, Owner::kInner}) {
    std::size_t count = 0;
    for (std::size_t k = 0; k < omega_o.size(); ++k) {
      if (owners[k] == who) {
        directions[count++] = omega_o[k];
      }
    }
    if (count == 0) {
      continue;
    }
    if (who == Owner::kThis) {
      estimate(omega_i, directions.first(count), values.first(count * n), origins.first(count));
    } else {
      inner_->eval_batch(omega_i, directions.first(count), values.first(count * n), origins.first(count));
    }
    std::size_t next = 0;
    for (std::size_t k = 0; k < omega_o.size(); ++k) {
      if (owners[k] == who) {
        std::copy_n(values.begin() + static_cast<std::ptrdiff_t>(next * n), n,
                    f_per_sr.begin() + static_cast<std::ptrdiff_t>(k * n));
        origin[k] = origins[next++];
      }
    }
  }
}

}  // namespace scatter::reflectance
