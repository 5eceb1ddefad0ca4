#include "host_sdk/reflectance/estimators/edge_extrapolator.h"

#include <fmt/format.h>

#include <algorithm>

#include "host_sdk/reflectance/estimators/bezier.h"
#include "host_sdk/reflectance/estimators/scratch.h"

namespace scatter::reflectance {

EdgeExtrapolator::EdgeExtrapolator(std::shared_ptr<const Brdf> inner, const Edge& edge)
    : Estimator(std::move(inner), region_beyond(edge)), edge_(edge) {}

Status EdgeExtrapolator::check(const Edge& edge) {
  if (!(edge.at > 0 && edge.at < kPi / 2)) {
    return fail(
        ErrorCode::kInvalidArgument,
        fmt::format("extrapolation: the edge is at {} deg, expected between 0 and 90 deg", degrees(edge.at)),
        "give the angle up to which the data is to be trusted");
  }
  return {};
}

void EdgeExtrapolator::estimate(const Direction& omega_i, std::span<const Direction> omega_o,
                                std::span<double> f_per_sr, std::span<Origin> origin) const noexcept {
  const EdgeMap on_edge(edge_, type(), omega_i);
  Scratch scratch;
  const std::span<Direction> asked = scratch.take<Direction>(omega_o.size());
  std::ranges::transform(omega_o, asked.begin(), on_edge);
  inner().eval_batch(on_edge.omega_i(), asked, f_per_sr, origin);
  const std::size_t n = channels();
  for (std::size_t k = 0; k < omega_o.size(); ++k) {
    origin[k] = combined(origin[k], Origin::kExtrapolated);
    const double share = factor(beyond(edge_, type(), omega_i, omega_o[k]));
    for (double& f : f_per_sr.subspan(k * n, n)) {
      f *= share;
    }
  }
}

bool EdgeExtrapolator::estimate_uncertainty(const Direction& omega_i, const Direction& omega_o,
                                            std::span<double> random_per_sr,
                                            std::span<double> systematic_per_sr) const noexcept {
  const EdgeMap on_edge(edge_, type(), omega_i);
  if (!inner().uncertainty(on_edge.omega_i(), on_edge(omega_o), random_per_sr, systematic_per_sr)) {
    return false;
  }
  const double share = factor(beyond(edge_, type(), omega_i, omega_o));
  for (std::size_t c = 0; c < channels(); ++c) {
    random_per_sr[c] *= share;
    systematic_per_sr[c] *= share;
  }
  return true;
}

Result<std::shared_ptr<const ClampExtrapolator>> ClampExtrapolator::make(std::shared_ptr<const Brdf> inner,
                                                                         const Edge& edge) {
  if (Status status = check(edge); !status) {
    return std::unexpected(status.error());
  }
  return std::shared_ptr<const ClampExtrapolator>(new ClampExtrapolator(std::move(inner), edge));
}

Result<std::shared_ptr<const GradientExtrapolator>> GradientExtrapolator::make(
    std::shared_ptr<const Brdf> inner, const Edge& edge, const Options& options) {
  if (Status status = check(edge); !status) {
    return std::unexpected(status.error());
  }
  if (!(options.p >= 0 && std::isfinite(options.p) && options.m > 0 && options.l >= 0 && options.l <= 1)) {
    return fail(ErrorCode::kInvalidArgument,
                fmt::format("gradient: p {}, m {} deg, l {}; expected p >= 0, m > 0, l in 0..1", options.p,
                            degrees(options.m), options.l),
                "correct the option");
  }
  return std::shared_ptr<const GradientExtrapolator>(
      new GradientExtrapolator(std::move(inner), edge, options));
}

double GradientExtrapolator::bend(double x, double l) noexcept {
  return bezier_value(bezier_parameter(x, l), 0, 1 - l, 1);
}

double GradientExtrapolator::factor(double distance) const noexcept {
  const double t = bend(std::min(distance / options_.m, 1.0), options_.l);
  return (1 - t) + t * options_.p;
}

}  // namespace scatter::reflectance
