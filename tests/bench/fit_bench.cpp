// Fitting Lambert + GGX to 20,000 samples of three channels, one thread. The peers: the same fit written
// the way Ceres's manual starts (one automatically differentiated residual per value, the truth's
// neighbourhood as its only start), and libbsdf's published figure (1.2 s from 5,000 samples).
#include <ceres/ceres.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <functional>
#include <memory>
#include <random>
#include <vector>

#include "host_sdk/reflectance/fitting/fit.h"
#include "host_sdk/reflectance/models/formulas/fresnel.h"
#include "host_sdk/reflectance/models/formulas/microfacet.h"
#include "host_sdk/reflectance/models/model_spec.h"
#include "tests/bench/bench.h"

namespace scatter::bench {
namespace {

using reflectance::FitSamples;
using reflectance::formulas::Geometry;

constexpr double kAlpha = 0.3;
constexpr std::size_t kPerIncidence = 5000;
constexpr double kLibbsdfSeconds = 1.2;

/// Even in solid angle up to 75 deg, at the instrument's incidences; relative normal noise.
FitSamples truth_samples(double noise) {
  const auto truth = reflectance::make_model("ggx:alpha=0.3,f0=0.04,albedo=0.2").value();
  FitSamples samples;
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  const double lowest = std::cos(reflectance::radians(75));
  for (const double theta_deg : {0.0, 20.0, 40.0, 60.0}) {
    const double theta_i = reflectance::radians(theta_deg);
    samples.incidences.push_back({theta_i, 0, samples.size(), kPerIncidence});
    for (std::size_t k = 0; k < kPerIncidence; ++k) {
      const double z = 1 - (1 - lowest) * (static_cast<double>(k) + 0.5) / kPerIncidence;
      samples.omega_o.push_back(
          reflectance::from_spherical(std::acos(z), 2.39996322972865332 * static_cast<double>(k)));
      samples.solid_angle_sr.push_back(2 * reflectance::kPi * (1 - lowest) / kPerIncidence);
      std::array<double, 3> f{};
      (void)truth->eval(reflectance::from_spherical(theta_i, 0), samples.omega_o.back(), f);
      for (const double value : f) {
        samples.f_per_sr.push_back(value * (1 + noise * normal(random)));
      }
    }
  }
  return samples;
}

double seconds_of(const std::function<void()>& work) {
  const auto start = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

/// Logarithmic residual of one value by (alpha), (albedo, f0).
struct OneValue {
  const Geometry* geometry;
  double floor;
  double target;

  template <typename T>
  bool operator()(const T* alpha, const T* colour, T* residual) const {
    using std::log;
    const T value =
        colour[0] / reflectance::kPi + reflectance::formulas::schlick_fresnel(colour[1], geometry->cos_d) *
                                           reflectance::formulas::ggx_lobe(alpha[0], *geometry);
    residual[0] = log(value * geometry->cos_o + floor) - target;
    return true;
  }
};

double plain_ceres(const FitSamples& samples, const std::vector<Geometry>& geometries) {
  double alpha = 0.2;
  std::array<std::array<double, 2>, 3> colour{{{0.3, 0.1}, {0.3, 0.1}, {0.3, 0.1}}};
  ceres::Problem problem;
  for (std::size_t k = 0; k < samples.size(); ++k) {
    for (std::size_t c = 0; c < 3; ++c) {
      const double value = samples.f_per_sr[k * 3 + c] * samples.omega_o[k].z;
      const double floor = 1e-4;
      problem.AddResidualBlock(new ceres::AutoDiffCostFunction<OneValue, 1, 1, 2>(
                                   new OneValue{&geometries[k], floor, std::log(value + floor)}),
                               nullptr, &alpha, colour[c].data());
    }
  }
  problem.SetParameterLowerBound(&alpha, 0, 0.001);
  problem.SetParameterUpperBound(&alpha, 0, 1);
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_NORMAL_CHOLESKY;
  options.num_threads = 1;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  return alpha;
}

std::vector<Figure> lambert_ggx() {
  const auto family = reflectance::fit_family("ggx").value();
  const FitSamples clean = truth_samples(0);
  const FitSamples noisy = truth_samples(0.03);
  std::vector<Geometry> geometries;
  for (const auto& incidence : clean.incidences) {
    for (std::size_t k = incidence.first; k < incidence.first + incidence.count; ++k) {
      geometries.push_back(reflectance::formulas::make_geometry(
          reflectance::from_spherical(incidence.theta_i, 0), clean.omega_o[k]));
    }
  }
  std::vector<double> ours;
  std::vector<double> theirs;
  double worst_alpha = 0;
  bool inside = true;
  for (int round = 0; round < 7; ++round) {
    for (const FitSamples* samples : {&clean, &noisy}) {
      Result<reflectance::FitResult> result;
      ours.push_back(seconds_of([&] { result = reflectance::fit(*samples, family); }));
      if (!result) {
        std::fprintf(stderr, "fit.lambert_ggx: %s\n", result.error().what.c_str());
        return {};
      }
      const auto& alpha = result->parameters.front();
      if (samples == &clean) {
        worst_alpha = std::max(worst_alpha, std::abs(alpha.value - kAlpha) / kAlpha);
      } else {
        inside = inside && alpha.low_95 <= kAlpha && kAlpha <= alpha.high_95;
      }
    }
    theirs.push_back(seconds_of([&] { keep(plain_ceres(clean, geometries)); }));
  }
  std::ranges::sort(ours);
  std::ranges::sort(theirs);
  const double seconds = ours[ours.size() / 2];
  if (worst_alpha > 0.01 || !inside) {
    std::fprintf(
        stderr,
        "fit.lambert_ggx: alpha is %.3g from the truth without noise, and %s its interval with noise\n",
        worst_alpha, inside ? "inside" : "outside");
  }
  return {make_figure("fit.lambert_ggx", seconds, "s", "Ceres, one autodiff residual per value",
                      theirs[theirs.size() / 2], Better::kLower),
          make_figure("fit.lambert_ggx.published", seconds, "s", "libbsdf, 5,000 samples", kLibbsdfSeconds,
                      Better::kLower)};
}

const Benchmark kLambertGgx{"fit.lambert_ggx", lambert_ggx};

}  // namespace
}  // namespace scatter::bench
