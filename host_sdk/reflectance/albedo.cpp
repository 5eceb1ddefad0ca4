#include "host_sdk/reflectance/albedo.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <queue>
#include <span>

namespace scatter::reflectance {
namespace {

/// Gauss-Legendre on [-1, 1].
constexpr std::array<double, 5> kNode5{-0.906179845938663993, -0.538469310105683091, 0.0,
                                       0.538469310105683091, 0.906179845938663993};
constexpr std::array<double, 5> kWeight5{0.236926885056189088, 0.478628670499366468, 0.568888888888888889,
                                         0.478628670499366468, 0.236926885056189088};
constexpr std::array<double, 3> kNode3{-0.774596669241483377, 0.0, 0.774596669241483377};
constexpr std::array<double, 3> kWeight3{5.0 / 9, 8.0 / 9, 5.0 / 9};
constexpr std::size_t kPerCell = 25 + 9;

struct Cell {
  double theta_low, theta_high, phi_low, phi_high;
  double error = 0;
  std::size_t values = 0;  ///< Offset of its integrals, one per channel.
  bool operator<(const Cell& other) const noexcept { return error < other.error; }
};

class Cubature {
 public:
  Cubature(const Brdf& brdf, const Direction& omega_i)
      : brdf_(brdf),
        omega_i_(omega_i),
        channels_(brdf.channels()),
        total_(channels_, 0.0),
        f_(25 * channels_),
        coarse_(channels_) {}

  void add(Cell cell) {
    cell.values = values_.size();
    values_.resize(values_.size() + channels_);
    const std::span<double> fine(values_.data() + cell.values, channels_);
    rule<3>(cell, kNode3, kWeight3, coarse_);
    rule<5>(cell, kNode5, kWeight5, fine);
    for (std::size_t c = 0; c < channels_; ++c) {
      cell.error = std::max(cell.error, std::abs(fine[c] - coarse_[c]));
      total_[c] += fine[c];
    }
    error_ += cell.error;
    evaluations_ += kPerCell;
    cells_.push(cell);
  }

  /// Cuts the worst cell into four.
  void refine() {
    const Cell worst = cells_.top();
    cells_.pop();
    error_ -= worst.error;
    for (std::size_t c = 0; c < channels_; ++c) {
      total_[c] -= values_[worst.values + c];
    }
    const double theta = (worst.theta_low + worst.theta_high) / 2;
    const double phi = (worst.phi_low + worst.phi_high) / 2;
    add({worst.theta_low, theta, worst.phi_low, phi});
    add({worst.theta_low, theta, phi, worst.phi_high});
    add({theta, worst.theta_high, worst.phi_low, phi});
    add({theta, worst.theta_high, phi, worst.phi_high});
  }

  [[nodiscard]] double error() const noexcept { return error_; }
  [[nodiscard]] std::size_t evaluations() const noexcept { return evaluations_; }
  [[nodiscard]] const std::vector<double>& total() const noexcept { return total_; }

 private:
  template <std::size_t N>
  void rule(const Cell& cell, const std::array<double, N>& node, const std::array<double, N>& weight,
            std::span<double> out) {
    std::array<Direction, N * N> omega_o;
    std::array<double, N * N> share{};
    const double half_theta = (cell.theta_high - cell.theta_low) / 2;
    const double half_phi = (cell.phi_high - cell.phi_low) / 2;
    const double side = brdf_.type() == ScatterType::kBtdf ? -1 : 1;
    for (std::size_t j = 0; j < N; ++j) {
      const double theta = cell.theta_low + half_theta * (1 + node[j]);
      for (std::size_t i = 0; i < N; ++i) {
        Direction& w = omega_o[j * N + i];
        w = from_spherical(theta, cell.phi_low + half_phi * (1 + node[i]));
        share[j * N + i] = weight[j] * weight[i] * half_theta * half_phi * w.z * std::sin(theta);
        w.z *= side;
      }
    }
    brdf_.eval_batch(omega_i_, omega_o, std::span(f_).first(N * N * channels_), {});
    std::ranges::fill(out, 0.0);
    for (std::size_t k = 0; k < N * N; ++k) {
      for (std::size_t c = 0; c < channels_; ++c) {
        out[c] += share[k] * f_[k * channels_ + c];
      }
    }
  }

  const Brdf& brdf_;
  Direction omega_i_;
  std::size_t channels_;
  std::priority_queue<Cell> cells_;
  std::vector<double> values_;
  std::vector<double> total_;
  std::vector<double> f_;
  std::vector<double> coarse_;
  double error_ = 0;
  std::size_t evaluations_ = 0;
};

/// Distances from the mirror direction at which the first cells end [rad].
constexpr std::array<double, 6> kRings{0.001, 0.004, 0.016, 0.06, 0.25, 0.8};

/// Break points that crowd around a centre, clipped to [low, high].
std::vector<double> breaks(double centre, double low, double high) {
  std::vector<double> out{low, high};
  for (const double ring : kRings) {
    out.push_back(centre - ring);
    out.push_back(centre + ring);
  }
  out.push_back(centre);
  std::erase_if(out, [&](double x) { return x < low || x > high; });
  std::ranges::sort(out);
  const auto repeated = std::ranges::unique(out);
  out.erase(repeated.begin(), repeated.end());
  return out;
}

}  // namespace

Albedo albedo(const Brdf& brdf, const Direction& omega_i, const AlbedoOptions& options) {
  Cubature cubature(brdf, omega_i);
  const double theta_mirror = theta_of(omega_i);
  const double phi_mirror = phi_of(omega_i) + kPi;
  const auto theta = breaks(theta_mirror, 0, kPi / 2);
  const auto phi = breaks(phi_mirror, phi_mirror - kPi, phi_mirror + kPi);
  for (std::size_t j = 0; j + 1 < theta.size(); ++j) {
    for (std::size_t i = 0; i + 1 < phi.size(); ++i) {
      cubature.add({theta[j], theta[j + 1], phi[i], phi[i + 1]});
    }
  }
  while (cubature.error() > options.tolerance && cubature.evaluations() < options.max_evaluations) {
    cubature.refine();
  }
  Albedo out{.value = cubature.total(), .dirac = std::vector<double>(brdf.channels(), 0.0)};
  (void)brdf.dirac(omega_i, out.dirac);
  out.error = cubature.error();
  out.converged = out.error <= options.tolerance;
  return out;
}

std::vector<double> grid_albedo(const GridBrdf& grid, std::size_t part, Region region) {
  const GridPart& content = grid.content().parts[part];
  std::vector<double> out(grid.channels(), 0.0);
  for (std::size_t n = 0; n < content.origin.size(); ++n) {
    const Origin origin = content.origin[n];
    if (origin == Origin::kInvalid || (region == Region::kMeasured && origin != Origin::kMeasured)) {
      continue;
    }
    const double share = grid.solid_angle_sr(n) * std::abs(grid.omega_o(n).z);
    for (std::size_t c = 0; c < out.size(); ++c) {
      out[c] += share * static_cast<double>(content.f_per_sr[c][n]);
    }
  }
  return out;
}

}  // namespace scatter::reflectance
