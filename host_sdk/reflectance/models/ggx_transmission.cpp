#include "host_sdk/reflectance/models/ggx_transmission.h"

#include <algorithm>
#include <cmath>

#include "host_sdk/reflectance/models/formulas/fresnel.h"
#include "host_sdk/reflectance/models/formulas/microfacet.h"
#include "host_sdk/reflectance/models/warp.h"

namespace scatter::reflectance {
namespace {

/// The facet that refracts omega_i into omega_o; `possible` when there is one.
struct Refraction {
  Direction h;
  double i_h = 0;
  double o_h = 0;
  bool possible = false;
};

Refraction refraction(double eta, const Direction& omega_i, const Direction& omega_o) noexcept {
  Refraction out;
  const Direction sum{-(omega_i.x + eta * omega_o.x), -(omega_i.y + eta * omega_o.y),
                      -(omega_i.z + eta * omega_o.z)};
  const double length2 = dot(sum, sum);
  if (!(length2 > 0)) {
    return out;
  }
  const double along = dot(omega_i, sum);
  const double s = (along < 0 ? -1 : 1) / std::sqrt(length2);
  out.h = {sum.x * s, sum.y * s, sum.z * s};
  out.i_h = along * s;
  out.o_h = dot(omega_o, out.h);
  out.possible = out.h.z > 0 && out.i_h > 0 && out.o_h < 0;
  return out;
}

}  // namespace

GgxTransmission::GgxTransmission(const Parameters& parameters) noexcept
    : parameters_(parameters),
      same_(parameters.alpha_x == uniform(parameters.alpha_x[0]) &&
            parameters.alpha_y == uniform(parameters.alpha_y[0]) &&
            parameters.eta == uniform(parameters.eta[0])) {}

double GgxTransmission::value(std::size_t c, const Direction& omega_i,
                              const Direction& omega_o) const noexcept {
  const double eta = parameters_.eta[c];
  const Refraction r = refraction(eta, omega_i, omega_o);
  if (!r.possible) {
    return 0;
  }
  const double x = parameters_.alpha_x[c];
  const double y = parameters_.alpha_y[c];
  const double path = r.i_h + eta * r.o_h;
  return r.i_h * -r.o_h * eta * eta * (1 - formulas::dielectric_fresnel(eta, r.i_h)) *
         formulas::ggx_distribution(x, y, r.h) * formulas::ggx_masking_over_cos(x, y, omega_i) *
         formulas::ggx_masking_over_cos(x, y, Direction{omega_o.x, omega_o.y, -omega_o.z}) / (path * path);
}

double GgxTransmission::density(std::size_t c, const Direction& omega_i,
                                const Direction& omega_o) const noexcept {
  const double eta = parameters_.eta[c];
  const Refraction r = refraction(eta, omega_i, omega_o);
  if (!r.possible) {
    return 0;
  }
  const double x = parameters_.alpha_x[c];
  const double y = parameters_.alpha_y[c];
  const double path = r.i_h + eta * r.o_h;
  return r.i_h * formulas::ggx_distribution(x, y, r.h) * formulas::ggx_masking_over_cos(x, y, omega_i) * eta *
         eta * -r.o_h / (path * path);
}

Origin GgxTransmission::eval(const Direction& omega_i, const Direction& omega_o,
                             std::span<double> f_per_sr) const noexcept {
  if (!(omega_i.z > 0 && omega_o.z < 0)) {
    std::ranges::fill(f_per_sr, 0.0);
    return Origin::kInvalid;
  }
  double lobe = value(0, omega_i, omega_o);
  for (std::size_t c = 0; c < kModelChannels; ++c) {
    if (!same_ && c > 0) {
      lobe = value(c, omega_i, omega_o);
    }
    f_per_sr[c] = lobe;
  }
  return Origin::kMeasured;
}

DrawnDirection GgxTransmission::sample(const Direction& omega_i, const SampleInput& u,
                                       std::span<double> throughput) const noexcept {
  std::ranges::fill(throughput, 0.0);
  DrawnDirection out{.omega_o = {-omega_i.x, -omega_i.y, -omega_i.z}};
  if (!(omega_i.z > 0)) {
    return out;
  }
  const std::size_t c = same_ ? 0 : warp::pick_channel(u[2]);
  const Direction h =
      warp::visible_ggx_facet(parameters_.alpha_x[c], parameters_.alpha_y[c], omega_i, u[0], u[1]);
  const double inverse = 1 / parameters_.eta[c];
  const double i_h = dot(omega_i, h);
  const double cos2 = 1 - inverse * inverse * (1 - i_h * i_h);
  if (!(cos2 > 0 && i_h > 0)) {
    return out;  // Total reflection: the draw is lost.
  }
  const double along = inverse * i_h - std::sqrt(cos2);
  out.omega_o = normalized({along * h.x - inverse * omega_i.x, along * h.y - inverse * omega_i.y,
                            along * h.z - inverse * omega_i.z});
  out.density = GgxTransmission::pdf(omega_i, out.omega_o);
  if (out.omega_o.z < 0 && out.density > 0) {
    (void)GgxTransmission::eval(omega_i, out.omega_o, throughput);
    for (double& t : throughput) {
      t *= -out.omega_o.z / out.density;
    }
  }
  return out;
}

double GgxTransmission::pdf(const Direction& omega_i, const Direction& omega_o) const noexcept {
  if (!(omega_i.z > 0)) {
    return 0;
  }
  return warp::channel_mean(same_, [&](std::size_t c) { return density(c, omega_i, omega_o); });
}

}  // namespace scatter::reflectance
