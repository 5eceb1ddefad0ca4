#include "host_sdk/measurement/tilt_fit.h"

#include <ceres/ceres.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>

#include "host_sdk/measurement/pixel_geometry.h"

namespace scatter::measurement {
namespace {

using reflectance::Direction;

constexpr double kLargestTilt = 8.0 * reflectance::kPi / 180.0;
constexpr double kToldStandardError = 0.05 * reflectance::kPi / 180.0;
constexpr double kLobeRegion = 15.0 * reflectance::kPi / 180.0;
// The lobe must lower chi-square by this factor of the remaining misfit before its place means anything.
constexpr double kSignificance = 50.0;

double g1(double cos_theta, double alpha2) noexcept {
  const double tan2 = std::max(0.0, 1.0 / (cos_theta * cos_theta) - 1.0);
  return 2.0 / (1.0 + std::sqrt(1.0 + alpha2 * tan2));
}

/// Lobe of unit height parameter; both directions in the sample's frame.
double lobe(const Direction& wi, const Direction& wo, double alpha, double f0) noexcept {
  if (wi.z <= 0 || wo.z <= 0) {
    return 0;
  }
  const Direction h = reflectance::normalized({wi.x + wo.x, wi.y + wo.y, wi.z + wo.z});
  const double alpha2 = alpha * alpha;
  const double c2 = h.z * h.z;
  const double k = c2 * (alpha2 - 1.0) + 1.0;
  const double d = alpha2 / (k * k);  // pi D; the constant goes into the height
  const double m = 1.0 - std::clamp(dot(wi, h), 0.0, 1.0);
  const double fresnel = f0 + (1.0 - f0) * m * m * m * m * m;
  return d * fresnel * g1(wi.z, alpha2) * g1(wo.z, alpha2) / (wi.z * wo.z);
}

/// Residuals of the problem with diffuse part and lobe height of every head solved for.
class Projected {
 public:
  explicit Projected(const std::vector<HeadSamples>& heads) : heads_(&heads) {
    for (const HeadSamples& head : heads) {
      count_ += head.f_per_sr.size();
    }
  }
  [[nodiscard]] std::size_t count() const noexcept { return count_; }

  // parameters: tilt x, tilt y [rad], ln alpha, logit f0
  bool operator()(double const* const* parameters, double* residuals) const {
    const double* p = parameters[0];
    const SampleFrame frame = sample_frame(p[0], p[1], 0.0);
    const double alpha = std::exp(p[2]);
    const double f0 = 1.0 / (1.0 + std::exp(-p[3]));
    std::size_t at = 0;
    for (const HeadSamples& head : *heads_) {
      const Direction wi = frame.to_sample(head.omega_i);
      const double irradiance = wi.z / head.omega_i.z;
      // Normal equations of f = irradiance (diffuse + height * lobe), weights 1 / sigma^2.
      double s11 = 0, s12 = 0, s22 = 0, b1 = 0, b2 = 0;
      scratch_.resize(std::max(scratch_.size(), head.f_per_sr.size()));
      for (std::size_t k = 0; k < head.f_per_sr.size(); ++k) {
        const double l = lobe(wi, frame.to_sample(head.omega_o[k]), alpha, f0);
        scratch_[k] = l;
        const double w = irradiance / head.sigma_per_sr[k];
        const double y = head.f_per_sr[k] / head.sigma_per_sr[k];
        s11 += w * w;
        s12 += w * w * l;
        s22 += w * w * l * l;
        b1 += w * y;
        b2 += w * l * y;
      }
      const double det = s11 * s22 - s12 * s12;
      double diffuse = 0;
      double height = 0;
      if (det > 1e-12 * s11 * s22) {
        diffuse = (b1 * s22 - b2 * s12) / det;
        height = (s11 * b2 - s12 * b1) / det;
      } else {
        diffuse = b1 / s11;
      }
      for (std::size_t k = 0; k < head.f_per_sr.size(); ++k) {
        residuals[at++] =
            (head.f_per_sr[k] - irradiance * (diffuse + height * scratch_[k])) / head.sigma_per_sr[k];
      }
    }
    return true;
  }

 private:
  const std::vector<HeadSamples>* heads_;
  std::size_t count_ = 0;
  mutable std::vector<double> scratch_;
};

double square_sum(const std::vector<double>& v) {
  double sum = 0;
  for (const double x : v) {
    sum += x * x;
  }
  return sum;
}

/// Chi-square without any lobe: each head is a constant.
double flat_chi_square(const std::vector<HeadSamples>& heads) {
  double total = 0;
  for (const HeadSamples& head : heads) {
    double w = 0, wy = 0, wyy = 0;
    for (std::size_t k = 0; k < head.f_per_sr.size(); ++k) {
      const double s = 1.0 / (head.sigma_per_sr[k] * head.sigma_per_sr[k]);
      w += s;
      wy += s * head.f_per_sr[k];
      wyy += s * head.f_per_sr[k] * head.f_per_sr[k];
    }
    total += wyy - wy * wy / w;
  }
  return total;
}

}  // namespace

std::optional<TiltFit> fit_tilt(const std::vector<HeadSamples>& heads) {
  const Projected projected(heads);
  if (heads.empty() || projected.count() < 200) {
    return std::nullopt;
  }
  std::vector<double> residuals(projected.count());

  // Start from the best of a coarse scan of lobe shapes on a level sample.
  std::array<double, 4> p{0, 0, 0, 0};
  double best = std::numeric_limits<double>::infinity();
  for (const double alpha : {0.04, 0.08, 0.16, 0.32, 0.6}) {
    for (const double f0 : {0.04, 0.7}) {
      const std::array<double, 4> trial{0, 0, std::log(alpha), std::log(f0 / (1 - f0))};
      const double* pointer = trial.data();
      projected(&pointer, residuals.data());
      const double chi2 = square_sum(residuals);
      if (chi2 < best) {
        best = chi2;
        p = trial;
      }
    }
  }

  auto* cost = new ceres::DynamicNumericDiffCostFunction<Projected, ceres::CENTRAL>(new Projected(projected));
  cost->AddParameterBlock(4);
  cost->SetNumResiduals(static_cast<int>(projected.count()));
  ceres::Problem problem;
  problem.AddResidualBlock(cost, nullptr, p.data());
  for (int i = 0; i < 2; ++i) {
    problem.SetParameterLowerBound(p.data(), i, -kLargestTilt);
    problem.SetParameterUpperBound(p.data(), i, kLargestTilt);
  }
  problem.SetParameterLowerBound(p.data(), 2, std::log(0.01));
  problem.SetParameterUpperBound(p.data(), 2, 0.0);
  problem.SetParameterLowerBound(p.data(), 3, std::log(0.005 / 0.995));
  problem.SetParameterUpperBound(p.data(), 3, std::log(0.999 / 0.001));
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_QR;
  options.max_num_iterations = 40;
  options.function_tolerance = 1e-7;
  options.logging_type = ceres::SILENT;
  options.num_threads = 1;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);

  const double* pointer = p.data();
  projected(&pointer, residuals.data());
  const double chi2 = square_sum(residuals);
  const double degrees =
      static_cast<double>(projected.count()) - 4.0 - 2.0 * static_cast<double>(heads.size());

  TiltFit fit;
  fit.alpha = std::exp(p[2]);
  fit.reduced_chi_square = chi2 / degrees;
  fit.tilt.x_rad = p[0];
  fit.tilt.y_rad = p[1];

  double lobe_sum = 0;
  std::size_t lobe_count = 0;
  std::size_t at = 0;
  const SampleFrame frame = sample_frame(p[0], p[1], 0.0);
  for (const HeadSamples& head : heads) {
    const Direction mirror = reflectance::mirrored(frame.to_sample(head.omega_i));
    for (std::size_t k = 0; k < head.f_per_sr.size(); ++k, ++at) {
      if (reflectance::angle_between(frame.to_sample(head.omega_o[k]), mirror) < kLobeRegion &&
          head.f_per_sr[k] > 0) {
        const double relative = residuals[at] * head.sigma_per_sr[k] / head.f_per_sr[k];
        lobe_sum += relative * relative;
        ++lobe_count;
      }
    }
  }
  fit.lobe_residual = lobe_count > 0 ? std::sqrt(lobe_sum / static_cast<double>(lobe_count)) : 0;

  // Covariance from the Jacobian of the projected residuals: it includes what the free heights,
  // diffuse parts and shape parameters leave uncertain.
  fit.tilt.standard_error_rad = std::numeric_limits<double>::infinity();
  ceres::Problem::EvaluateOptions evaluate;
  ceres::CRSMatrix jacobian;
  problem.Evaluate(evaluate, nullptr, nullptr, nullptr, &jacobian);
  Eigen::Matrix4d normal = Eigen::Matrix4d::Zero();
  for (int row = 0; row < jacobian.num_rows; ++row) {
    std::array<double, 4> j{};
    for (int k = jacobian.rows[static_cast<std::size_t>(row)];
         k < jacobian.rows[static_cast<std::size_t>(row) + 1]; ++k) {
      j[static_cast<std::size_t>(jacobian.cols[static_cast<std::size_t>(k)])] =
          jacobian.values[static_cast<std::size_t>(k)];
    }
    const Eigen::Map<const Eigen::Vector4d> v(j.data());
    normal += v * v.transpose();
  }
  // A shape parameter at its bound or without influence must not make the matrix singular.
  normal.diagonal().array() += 1e-9;
  const Eigen::Matrix4d covariance =
      normal.ldlt().solve(Eigen::Matrix4d::Identity()) * std::max(1.0, fit.reduced_chi_square);
  const double worst = std::max(covariance(0, 0), covariance(1, 1));
  if (std::isfinite(worst) && worst > 0) {
    fit.tilt.standard_error_rad = std::sqrt(worst);
  }
  const double gained = flat_chi_square(heads) - chi2;
  const bool significant =
      gained > kSignificance * std::max(1.0, fit.reduced_chi_square) * static_cast<double>(heads.size());
  fit.tilt.told = significant && fit.tilt.standard_error_rad <= kToldStandardError;
  return fit;
}

}  // namespace scatter::measurement
