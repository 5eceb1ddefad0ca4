#include "host_sdk/reflectance/estimators/horizon_extrapolator.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "host_sdk/reflectance/estimators/bezier.h"
#include "host_sdk/reflectance/estimators/scratch.h"

namespace scatter::reflectance {
namespace {

/// Over which the slope at the edge is taken [rad].
constexpr double kSlopeStep = radians(1);

/// x in 0..1 from the edge to the horizon, slope in change per unit of x.
double bezier_down(double edge, double slope, double x) noexcept {
  double middle = 0.5;
  double y1 = edge + slope * middle;
  if (edge > 0 && y1 < 0) {
    middle = edge / -slope;
    y1 = 0;
  }
  return bezier_value(bezier_parameter(x, middle), edge, y1, 0);
}

}  // namespace

std::string_view name(HorizonMode mode) noexcept {
  switch (mode) {
    case HorizonMode::kNone:
      return "none";
    case HorizonMode::kLinear:
      return "linear";
    case HorizonMode::kConstant:
      return "constant";
    case HorizonMode::kBezier:
      return "bezier";
  }
  return "unknown";
}

Result<std::shared_ptr<const HorizonExtrapolator>> HorizonExtrapolator::make(
    std::shared_ptr<const Brdf> inner, HorizonMode mode, double from) {
  if (!(from > kSlopeStep && from < kPi / 2 - kSameAngle)) {
    return fail(ErrorCode::kInvalidArgument,
                fmt::format("{}: the data is to end at theta_o = {} deg, expected between 1 and 90 deg",
                            name(mode), degrees(from)),
                "give the theta_o up to which the data is to be trusted");
  }
  return std::shared_ptr<const HorizonExtrapolator>(new HorizonExtrapolator(std::move(inner), mode, from));
}

HorizonExtrapolator::HorizonExtrapolator(std::shared_ptr<const Brdf> inner, HorizonMode mode, double from)
    : Estimator(std::move(inner), region_beyond({.axis = Edge::Axis::kThetaO, .at = from})),
      mode_(mode),
      from_(from) {}

double HorizonExtrapolator::progress(const Direction& omega_o) const noexcept {
  return std::clamp((exit_theta(type(), omega_o) - from_) / (kPi / 2 - from_), 0.0, 1.0);
}

void HorizonExtrapolator::values_on(double theta_o, const Direction& omega_i,
                                    std::span<const Direction> omega_o, std::span<double> f_per_sr,
                                    std::span<Origin> origin) const noexcept {
  const EdgeMap on_ring({.axis = Edge::Axis::kThetaO, .at = theta_o}, type(), omega_i);
  Scratch scratch;
  const std::span<Direction> asked = scratch.take<Direction>(omega_o.size());
  std::ranges::transform(omega_o, asked.begin(), on_ring);
  inner().eval_batch(omega_i, asked, f_per_sr, origin);
}

void HorizonExtrapolator::estimate(const Direction& omega_i, std::span<const Direction> omega_o,
                                   std::span<double> f_per_sr, std::span<Origin> origin) const noexcept {
  if (mode_ == HorizonMode::kNone) {
    std::ranges::fill(f_per_sr, 0.0);
    std::ranges::fill(origin, Origin::kInvalid);
    return;
  }
  values_on(from_, omega_i, omega_o, f_per_sr, origin);
  for (Origin& o : origin) {
    o = combined(o, Origin::kExtrapolated);
  }
  if (mode_ == HorizonMode::kConstant) {
    return;
  }
  const std::size_t n = channels();
  if (mode_ == HorizonMode::kLinear) {
    for (std::size_t k = 0; k < omega_o.size(); ++k) {
      const double share = 1 - progress(omega_o[k]);
      for (double& f : f_per_sr.subspan(k * n, n)) {
        f *= share;
      }
    }
    return;
  }
  Scratch scratch;
  const std::span<double> inside = scratch.take<double>(omega_o.size() * n);
  const std::span<Origin> inside_origin = scratch.take<Origin>(omega_o.size());
  values_on(from_ - kSlopeStep, omega_i, omega_o, inside, inside_origin);
  const double steps = (kPi / 2 - from_) / kSlopeStep;
  for (std::size_t k = 0; k < omega_o.size(); ++k) {
    origin[k] = combined(origin[k], inside_origin[k]);
    const double x = progress(omega_o[k]);
    for (std::size_t c = 0; c < n; ++c) {
      double& f = f_per_sr[k * n + c];
      f = origin[k] == Origin::kInvalid ? 0 : bezier_down(f, (f - inside[k * n + c]) * steps, x);
    }
  }
}

bool HorizonExtrapolator::estimate_uncertainty(const Direction& omega_i, const Direction& omega_o,
                                               std::span<double> random_per_sr,
                                               std::span<double> systematic_per_sr) const noexcept {
  const EdgeMap on_edge({.axis = Edge::Axis::kThetaO, .at = from_}, type(), omega_i);
  if (mode_ == HorizonMode::kNone ||
      !inner().uncertainty(omega_i, on_edge(omega_o), random_per_sr, systematic_per_sr)) {
    return false;
  }
  const std::size_t n = channels();
  Scratch scratch;
  const std::span<double> edge = scratch.take<double>(n);
  const std::span<double> here = scratch.take<double>(n);
  Origin origin = Origin::kInvalid;
  estimate(omega_i, std::span(&omega_o, 1), here, std::span(&origin, 1));
  values_on(from_, omega_i, std::span(&omega_o, 1), edge, std::span(&origin, 1));
  for (std::size_t c = 0; c < n; ++c) {
    if (edge[c] > 0) {
      random_per_sr[c] *= std::abs(here[c] / edge[c]);
      systematic_per_sr[c] *= std::abs(here[c] / edge[c]);
    }
  }
  return true;
}

}  // namespace scatter::reflectance
