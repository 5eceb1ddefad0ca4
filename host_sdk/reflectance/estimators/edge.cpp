#include "host_sdk/reflectance/estimators/edge.h"

#include <algorithm>
#include <cmath>

namespace scatter::reflectance {
namespace {

/// As IncidenceInterpolator: models have no value exactly on the horizon.
constexpr double kGrazing = 1e-9;

}  // namespace

AngularRegion region_beyond(const Edge& edge) noexcept {
  AngularRegion region;
  // Regions include their ends and allow for kSameAngle, so twice that keeps the edge out.
  const double from = edge.upper ? edge.at + 2 * kSameAngle : 0;
  const double to = edge.upper ? kPi / 2 : edge.at - 2 * kSameAngle;
  if (edge.axis == Edge::Axis::kThetaI) {
    region.theta_i_from = from;
    region.theta_i_to = to;
  } else {
    region.theta_o_from = from;
    region.theta_o_to = to;
  }
  return region;
}

double beyond(const Edge& edge, ScatterType type, const Direction& omega_i,
              const Direction& omega_o) noexcept {
  const double theta = edge.axis == Edge::Axis::kThetaI ? theta_of(omega_i) : exit_theta(type, omega_o);
  return std::max(0.0, edge.upper ? theta - edge.at : edge.at - theta);
}

EdgeMap::EdgeMap(const Edge& edge, ScatterType type, const Direction& omega_i) noexcept
    : axis_(edge.axis),
      side_(type == ScatterType::kBrdf ? 1 : -1),
      cos_at_(std::cos(edge.at)),
      sin_at_(std::sin(edge.at)),
      on_edge_(omega_i) {
  if (axis_ == Edge::Axis::kThetaO) {
    return;
  }
  const double sin_theta = std::hypot(omega_i.x, omega_i.y);
  const bool normal = sin_theta < kSameAngle;
  cos_i_ = normal ? std::cos(edge.azimuth) : omega_i.x / sin_theta;
  sin_i_ = normal ? std::sin(edge.azimuth) : omega_i.y / sin_theta;
  const double turn = edge.at - std::atan2(sin_theta, omega_i.z);
  cos_turn_ = std::cos(turn);
  sin_turn_ = std::sin(turn);
  on_edge_ = {sin_at_ * cos_i_, sin_at_ * sin_i_, cos_at_};
}

Direction EdgeMap::operator()(const Direction& o) const noexcept {
  if (axis_ == Edge::Axis::kThetaO) {
    const double level = std::hypot(o.x, o.y);
    return level > 0 ? Direction{o.x / level * sin_at_, o.y / level * sin_at_, side_ * cos_at_}
                     : Direction{sin_at_, 0, side_ * cos_at_};
  }
  const double x = o.x * cos_i_ + o.y * sin_i_;
  const double y = o.y * cos_i_ - o.x * sin_i_;
  const double z = side_ * o.z;
  Direction w{x * cos_turn_ - z * sin_turn_, y, x * sin_turn_ + z * cos_turn_};
  if (w.z < kGrazing) {
    const double level = std::hypot(w.x, w.y);
    w = level > 0 ? Direction{w.x / level, w.y / level, kGrazing} : Direction{-1, 0, kGrazing};
  }
  return {w.x * cos_i_ - w.y * sin_i_, w.x * sin_i_ + w.y * cos_i_, side_ * w.z};
}

}  // namespace scatter::reflectance
