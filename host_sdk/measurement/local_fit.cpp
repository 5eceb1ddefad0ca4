#include "host_sdk/measurement/local_fit.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>

namespace scatter::measurement {

using reflectance::Direction;

namespace {

/// Two unit vectors that span the tangent plane; which ones does not matter to the fit.
struct TangentPlane {
  Direction u;
  Direction v;
};

TangentPlane tangent_plane(const Direction& w) noexcept {
  const Direction helper = std::abs(w.z) < 0.9 ? Direction{0, 0, 1} : Direction{1, 0, 0};
  const Direction u = reflectance::normalized(reflectance::cross(helper, w));
  return {u, reflectance::cross(w, u)};
}

constexpr std::size_t kTerms = 6;

/// Candidate pixels of one fit in tangent-plane coordinates divided by the radius.
struct Candidates {
  std::vector<std::uint32_t> pixel;
  std::vector<float> u;
  std::vector<float> v;
  std::vector<float> kernel;
  void clear() {
    pixel.clear();
    u.clear();
    v.clear();
    kernel.clear();
  }
};

}  // namespace

double FitWeights::noise_gain() const noexcept {
  double sum = 0;
  for (const float h : weight) {
    sum += static_cast<double>(h) * static_cast<double>(h);
  }
  return sum;
}

double LocalFit::pixels_per_radian(const Direction& w) const noexcept {
  const double theta = reflectance::theta_of(w);
  const double step = 1e-3;
  const double near = std::max(theta - step, 0.0);
  const double radial =
      (image_radius_px(*optics_, theta + step) - image_radius_px(*optics_, near)) / (theta + step - near);
  const double tangential = theta > step ? image_radius_px(*optics_, theta) / std::sin(theta) : radial;
  return std::min(radial, tangential);
}

bool LocalFit::solve(const FitRequest& request, std::span<const float> variance, std::size_t lanes,
                     std::size_t lane, FitWeights& out) const {
  out.pixel.clear();
  out.weight.clear();
  const TangentPlane plane = tangent_plane(request.centre);
  const SensorPoint at = project(*optics_, request.centre);
  const double theta = reflectance::theta_of(request.centre);
  const double step = 1e-3;
  const double radial = (image_radius_px(*optics_, theta + step) - image_radius_px(*optics_, theta)) / step;
  const double tangential = theta > step ? image_radius_px(*optics_, theta) / std::sin(theta) : radial;
  const double reach = request.radius_rad * std::max(radial, tangential) * 1.02 + 1.0;
  const auto clamp_to = [](double value, int limit) { return std::clamp(static_cast<int>(value), 0, limit); };
  const int i0 = clamp_to(std::floor(at.x - reach), pixels_->width);
  const int i1 = clamp_to(std::ceil(at.x + reach), pixels_->width);
  const int j0 = clamp_to(std::floor(at.y - reach), pixels_->height);
  const int j1 = clamp_to(std::ceil(at.y + reach), pixels_->height);

  thread_local Candidates c;
  c.clear();
  const auto inverse_radius = static_cast<float>(1.0 / request.radius_rad);
  const std::array<float, 9> m{static_cast<float>(plane.u.x),        static_cast<float>(plane.u.y),
                               static_cast<float>(plane.u.z),        static_cast<float>(plane.v.x),
                               static_cast<float>(plane.v.y),        static_cast<float>(plane.v.z),
                               static_cast<float>(request.centre.x), static_cast<float>(request.centre.y),
                               static_cast<float>(request.centre.z)};
  for (int j = j0; j < j1; j += request.stride) {
    for (int i = i0; i < i1; i += request.stride) {
      const auto p = static_cast<std::uint32_t>(j * pixels_->width + i);
      if (pixels_->usable[p] == 0) {
        continue;
      }
      const float u = (m[0] * pixels_->x[p] + m[1] * pixels_->y[p] + m[2] * pixels_->z[p]) * inverse_radius;
      const float v = (m[3] * pixels_->x[p] + m[4] * pixels_->y[p] + m[5] * pixels_->z[p]) * inverse_radius;
      const float kernel = 1.0F - u * u - v * v;
      if (kernel <= 0.0F) {
        continue;
      }
      if (!variance.empty() && std::isinf(variance[std::size_t{p} * lanes + lane])) {
        continue;
      }
      c.pixel.push_back(p);
      c.u.push_back(u);
      c.v.push_back(v);
      c.kernel.push_back(kernel);
    }
  }

  const std::size_t terms = request.order == 2 ? kTerms : 3;
  if (c.pixel.size() < 2 * terms) {
    return false;
  }
  // Moments sum k u^a v^b fill the normal matrix of the basis 1, u, v, u^2, u v, v^2.
  std::array<double, 15> s{};
  for (std::size_t k = 0; k < c.pixel.size(); ++k) {
    const auto w = static_cast<double>(c.kernel[k]);
    const auto u = static_cast<double>(c.u[k]);
    const auto v = static_cast<double>(c.v[k]);
    const double uu = u * u;
    const double uv = u * v;
    const double vv = v * v;
    s[0] += w;
    s[1] += w * u;
    s[2] += w * v;
    s[3] += w * uu;
    s[4] += w * uv;
    s[5] += w * vv;
    s[6] += w * uu * u;
    s[7] += w * uu * v;
    s[8] += w * uv * v;
    s[9] += w * vv * v;
    s[10] += w * uu * uu;
    s[11] += w * uu * uv;
    s[12] += w * uu * vv;
    s[13] += w * uv * vv;
    s[14] += w * vv * vv;
  }
  Eigen::Matrix<double, kTerms, kTerms> a;
  a << s[0], s[1], s[2], s[3], s[4], s[5],    //
      s[1], s[3], s[4], s[6], s[7], s[8],     //
      s[2], s[4], s[5], s[7], s[8], s[9],     //
      s[3], s[6], s[7], s[10], s[11], s[12],  //
      s[4], s[7], s[8], s[11], s[12], s[13],  //
      s[5], s[8], s[9], s[12], s[13], s[14];
  Eigen::Matrix<double, kTerms, 1> wanted = Eigen::Matrix<double, kTerms, 1>::Zero();
  wanted[0] = 1;
  Eigen::Matrix<double, kTerms, 1> y = Eigen::Matrix<double, kTerms, 1>::Zero();
  if (terms == kTerms) {
    const double blur = request.blur_variance_rad2 / (request.radius_rad * request.radius_rad);
    wanted[3] = -blur;
    wanted[5] = -blur;
    const Eigen::LDLT<Eigen::Matrix<double, kTerms, kTerms>> ldlt(a);
    if (ldlt.info() != Eigen::Success || ldlt.vectorD().minCoeff() <= 1e-9 * s[0]) {
      return false;
    }
    y = ldlt.solve(wanted);
  } else {
    const Eigen::Matrix3d linear = a.topLeftCorner<3, 3>();
    const Eigen::LDLT<Eigen::Matrix3d> ldlt(linear);
    if (ldlt.info() != Eigen::Success || ldlt.vectorD().minCoeff() <= 1e-9 * s[0]) {
      return false;
    }
    y.head<3>() = ldlt.solve(wanted.head<3>());
  }
  out.pixel.assign(c.pixel.begin(), c.pixel.end());
  out.weight.resize(c.pixel.size());
  for (std::size_t k = 0; k < c.pixel.size(); ++k) {
    const auto u = static_cast<double>(c.u[k]);
    const auto v = static_cast<double>(c.v[k]);
    const double basis = y[0] + u * (y[1] + y[3] * u + y[4] * v) + v * (y[2] + y[5] * v);
    out.weight[k] = static_cast<float>(basis * static_cast<double>(c.kernel[k]));
  }
  return true;
}

}  // namespace scatter::measurement
