#include "host_sdk/reflectance/fitting/open_pbr.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "host_sdk/reflectance/fitting/fit_data.h"
#include "host_sdk/reflectance/models/formulas/fresnel.h"
#include "host_sdk/reflectance/models/formulas/microfacet.h"

namespace scatter::reflectance {
namespace {

constexpr std::size_t kAlbedoNodes = 33;
/// Facet normals per albedo: quadrature over their slopes, in which every roughness looks alike.
constexpr int kSlopes = 24;
constexpr int kAzimuths = 48;

/// Albedo of F * lobe: facets drawn by GGX, D cos_h dh, each reflecting F G1(o) into its direction.
/// With xi = tan^2 / (alpha^2 + tan^2) uniform in 0..1, D cos_h dh is d xi d phi / (2 pi).
double lobe_albedo(double alpha, double ior, double cos_i) {
  const Direction omega_i{std::sqrt(1 - cos_i * cos_i), 0, cos_i};
  double sum = 0;
  for (int a = 0; a < kSlopes; ++a) {
    const double xi = (a + 0.5) / kSlopes;
    const double tan_h = alpha * std::sqrt(xi / (1 - xi));
    const double cos_h = 1 / std::sqrt(1 + tan_h * tan_h);
    for (int b = 0; b < kAzimuths; ++b) {
      const double phi = 2 * kPi * (b + 0.5) / kAzimuths;
      const Direction h{tan_h * cos_h * std::cos(phi), tan_h * cos_h * std::sin(phi), cos_h};
      const double cos_d = dot(omega_i, h);
      const double cos_o = 2 * cos_d * h.z - cos_i;
      if (cos_d > 0 && cos_o > 0) {
        // f cos_o / pdf with f = F D G1 G1 / (4 cos_i cos_o) and pdf = D cos_h / (4 cos_d).
        sum += formulas::dielectric_fresnel(ior, cos_d) * formulas::ggx_masking_over_cos(alpha, cos_i) *
               formulas::ggx_masking_over_cos(alpha, cos_o) * cos_o * cos_d / h.z;
      }
    }
  }
  return std::min(sum / (kSlopes * kAzimuths), 1.0);
}

}  // namespace

OpenPbr::OpenPbr(Parameters parameters) : parameters_(std::move(parameters)) {
  const double alpha = parameters_.roughness * parameters_.roughness;
  for (std::size_t k = 0; k < kAlbedoNodes; ++k) {
    const double cosine = static_cast<double>(k) / static_cast<double>(kAlbedoNodes - 1);
    albedo_.push_back(parameters_.ior > 1 ? lobe_albedo(alpha, parameters_.ior, std::max(cosine, 1e-3))
                                          : 0.0);
  }
}

double OpenPbr::specular_albedo(double cos_theta) const noexcept {
  const double place = std::clamp(cos_theta, 0.0, 1.0) * static_cast<double>(kAlbedoNodes - 1);
  const auto below = std::min(static_cast<std::size_t>(place), kAlbedoNodes - 2);
  const double share = place - static_cast<double>(below);
  return albedo_[below] * (1 - share) + albedo_[below + 1] * share;
}

OpenPbr::Terms OpenPbr::terms(const Direction& omega_i, const Direction& omega_o) const noexcept {
  const formulas::Geometry g = formulas::make_geometry(omega_i, omega_o);
  const double alpha = parameters_.roughness * parameters_.roughness;
  const double lobe = formulas::ggx_lobe(alpha, g);
  const double fresnel = parameters_.ior > 1 ? formulas::dielectric_fresnel(parameters_.ior, g.cos_d) : 0.0;
  const double s = formulas::schlick_weight(g.cos_d);
  const double metal = parameters_.metalness;
  return {.rest = lobe * ((1 - metal) * fresnel + metal * s),
          .factor = (1 - metal) * (1 - specular_albedo(g.cos_o)) / kPi + metal * lobe * (1 - s)};
}

Origin OpenPbr::eval(const Direction& omega_i, const Direction& omega_o,
                     std::span<double> f_per_sr) const noexcept {
  if (!(omega_i.z > 0 && omega_o.z > 0)) {
    std::ranges::fill(f_per_sr, 0.0);
    return Origin::kInvalid;
  }
  const Terms t = terms(omega_i, omega_o);
  for (std::size_t c = 0; c < channels(); ++c) {
    f_per_sr[c] = t.rest + parameters_.base_color[c] * t.factor;
  }
  return Origin::kInterpolated;
}

Result<OpenPbr> OpenPbr::recoloured(const FitSamples& samples) const {
  if (const auto sound = check(samples); !sound) {
    return std::unexpected(sound.error());
  }
  if (samples.channels != channels()) {
    return fail(ErrorCode::kInvalidArgument,
                fmt::format("recolouring {} channels by samples of {}", channels(), samples.channels),
                "use samples of the same channels");
  }
  std::vector<Terms> all;
  all.reserve(samples.size());
  for (const FitSamples::Incidence& incidence : samples.incidences) {
    const Direction omega_i = from_spherical(incidence.theta_i, incidence.phi_i);
    for (std::size_t k = incidence.first; k < incidence.first + incidence.count; ++k) {
      all.push_back(terms(omega_i, samples.omega_o[k]));
    }
  }
  const std::vector<double> floor = residual_floor(samples);
  OpenPbr out = *this;
  for (std::size_t c = 0; c < channels(); ++c) {
    double& base = out.parameters_.base_color[c];
    for (int step = 0; step < 30; ++step) {  // Gauss-Newton in one unknown
      double gradient = 0;
      double curvature = 0;
      for (std::size_t k = 0; k < samples.size(); ++k) {
        const double cosine = samples.omega_o[k].z;
        const double model = (all[k].rest + base * all[k].factor) * cosine + floor[c];
        const double measured =
            std::max(samples.f_per_sr[k * samples.channels + c] * cosine + floor[c], 0.1 * floor[c]);
        const double slope = all[k].factor * cosine / model;
        gradient += samples.solid_angle_sr[k] * slope * std::log(model / measured);
        curvature += samples.solid_angle_sr[k] * slope * slope;
      }
      const double next = curvature > 0 ? std::clamp(base - gradient / curvature, 0.0, 1.0) : base;
      const bool done = std::abs(next - base) < 1e-9;
      base = next;
      if (done) {
        break;
      }
    }
  }
  return out;
}

}  // namespace scatter::reflectance
