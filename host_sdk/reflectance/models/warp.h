// Maps from uniform numbers to directions, with their densities.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "host_sdk/reflectance/direction.h"
#include "host_sdk/reflectance/models/formulas/microfacet.h"
#include "host_sdk/reflectance/models/model_channels.h"

namespace scatter::reflectance::warp {

/// Density cos / pi about +z.
[[nodiscard]] inline Direction cosine(double u1, double u2) noexcept {
  const double r = std::sqrt(u1);
  const double phi = 2 * kPi * u2;
  return {r * std::cos(phi), r * std::sin(phi), std::sqrt(1 - u1)};
}

/// Density (n + 1) / (2 pi) cos^n about a unit axis, 0 behind it.
[[nodiscard]] inline Direction power_cosine(const Direction& axis, double n, double u1, double u2) noexcept {
  // 1 - u1 is never 0, and log1p keeps the digits of narrow lobes.
  const double log_cos = std::log1p(-u1) / (n + 1);
  const double cos_a = std::exp(log_cos);
  const double sin_a = std::sqrt(-std::expm1(2 * log_cos));
  const double phi = 2 * kPi * u2;
  // A frame about the axis without a singular direction (Duff and others 2017).
  const double sign = std::copysign(1.0, axis.z);
  const double a = -1 / (sign + axis.z);
  const double b = axis.x * axis.y * a;
  const Direction x{1 + sign * axis.x * axis.x * a, sign * b, -sign * axis.x};
  const Direction y{b, sign + axis.y * axis.y * a, -axis.y};
  const double cx = sin_a * std::cos(phi);
  const double cy = sin_a * std::sin(phi);
  return normalized({cx * x.x + cy * y.x + cos_a * axis.x, cx * x.y + cy * y.y + cos_a * axis.y,
                     cx * x.z + cy * y.z + cos_a * axis.z});
}

/// omega_i mirrored at a facet with unit normal h.
[[nodiscard]] inline Direction reflect(const Direction& omega_i, const Direction& h) noexcept {
  const double c = 2 * dot(omega_i, h);
  return normalized({c * h.x - omega_i.x, c * h.y - omega_i.y, c * h.z - omega_i.z});
}

/// The facet normal with z > 0 that mirrors omega_i into omega_o, either of which may be below the
/// surface; z = 0 for opposite directions.
[[nodiscard]] inline Direction facet_normal(const Direction& omega_i, const Direction& omega_o) noexcept {
  const Direction sum{omega_i.x + omega_o.x, omega_i.y + omega_o.y, omega_i.z + omega_o.z};
  const double length2 = dot(sum, sum);
  if (!(length2 > 0)) {
    return {1, 0, 0};
  }
  const double s = (sum.z < 0 ? -1 : 1) / std::sqrt(length2);
  return {sum.x * s, sum.y * s, sum.z * s};
}

/// Facet normal with Gaussian slopes: density D cos_h with Beckmann's D (any azimuth's alpha).
[[nodiscard]] inline Direction gaussian_facet(double alpha_x, double alpha_y, double u1, double u2) noexcept {
  const double r = std::sqrt(-std::log1p(-u1));
  const double phi = 2 * kPi * u2;
  return normalized({alpha_x * r * std::cos(phi), alpha_y * r * std::sin(phi), 1});
}

/// Density of `reflect(omega_i, gaussian_facet(...))` [1/sr].
/// Source  Walter 2007, eq. 14 and 24.
[[nodiscard]] inline double gaussian_facet_pdf(double alpha_x, double alpha_y, const Direction& omega_i,
                                               const Direction& omega_o) noexcept {
  const Direction h = facet_normal(omega_i, omega_o);
  if (!(h.z > 0)) {
    return 0;
  }
  const double x = h.x / (h.z * alpha_x);
  const double y = h.y / (h.z * alpha_y);
  const double cos_d = std::abs(dot(omega_i, h));
  return std::exp(-(x * x + y * y)) / (kPi * alpha_x * alpha_y * h.z * h.z * h.z * 4 * cos_d);
}

/// Facet normal with the density of those of GGX that omega_i sees: D max(i.h, 0) G1(i) / cos_i.
/// Range   omega_i.z > 0.
/// Source  Heitz 2018 for the density; drawn with the spherical caps of Dupuy and Benyoub 2023.
[[nodiscard]] inline Direction visible_ggx_facet(double alpha_x, double alpha_y, const Direction& omega_i,
                                                 double u1, double u2) noexcept {
  const Direction i = normalized({alpha_x * omega_i.x, alpha_y * omega_i.y, omega_i.z});
  const double z = (1 - u2) * (1 + i.z) - i.z;
  const double s = std::sqrt(std::clamp(1 - z * z, 0.0, 1.0));
  const double phi = 2 * kPi * u1;
  const Direction h{s * std::cos(phi) + i.x, s * std::sin(phi) + i.y, z + i.z};
  return normalized({alpha_x * h.x, alpha_y * h.y, std::max(h.z, 1e-300)});
}

/// Density of `reflect(omega_i, visible_ggx_facet(...))` [1/sr].
[[nodiscard]] inline double visible_ggx_reflection_pdf(double alpha_x, double alpha_y,
                                                       const Direction& omega_i,
                                                       const Direction& omega_o) noexcept {
  if (!(omega_i.z + omega_o.z > 0)) {
    return 0;  // A facet that points down, which does not exist.
  }
  const Direction h = facet_normal(omega_i, omega_o);
  return formulas::ggx_distribution(alpha_x, alpha_y, h) *
         formulas::ggx_masking_over_cos(alpha_x, alpha_y, omega_i) / 4;
}

/// Facet normal with density D cos_h, D = GTR1.
/// Source  Burley 2012, appendix B.
[[nodiscard]] inline Direction gtr1_facet(double alpha, double u1, double u2) noexcept {
  const double a2 = alpha * alpha;
  const double cos2 = std::clamp((1 - std::pow(a2, 1 - u1)) / (1 - a2), 0.0, 1.0);
  const double s = std::sqrt(1 - cos2);
  const double phi = 2 * kPi * u2;
  return {s * std::cos(phi), s * std::sin(phi), std::sqrt(cos2)};
}

/// Which channel's parameters to draw with, when they differ: u in [0, 1).
[[nodiscard]] inline std::size_t pick_channel(double u) noexcept {
  return std::min(static_cast<std::size_t>(u * static_cast<double>(kModelChannels)), kModelChannels - 1);
}

/// Mean over the channels of density(c); one call when `same`.
template <typename Density>
[[nodiscard]] double channel_mean(bool same, const Density& density) noexcept {
  if (same) {
    return density(std::size_t{0});
  }
  double sum = 0;
  for (std::size_t c = 0; c < kModelChannels; ++c) {
    sum += density(c);
  }
  return sum / static_cast<double>(kModelChannels);
}

}  // namespace scatter::reflectance::warp
