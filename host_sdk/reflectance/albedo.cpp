#include "host_sdk/reflectance/albedo.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <queue>
#include <span>

#include "host_sdk/reflectance/specular_grid_brdf.h"

namespace scatter::reflectance {
namespace {

/// Gauss-Legendre on [-1, 1].
constexpr std::array<double, 5> kNode5{-0.906179845938663993, -0.538469310105683091, 0.0,
                                       0.538469310105683091, 0.906179845938663993};
constexpr std::array<double, 5> kWeight5{0.236926885056189088, 0.478628670499366468, 0.568888888888888889,
                                         0.478628670499366468, 0.236926885056189088};
constexpr std::array<double, 3> kNode3{-0.774596669241483377, 0.0, 0.774596669241483377};
constexpr std::array<double, 3> kWeight3{5.0 / 9, 8.0 / 9, 5.0 / 9};
constexpr std::size_t kCoarse = 9;
constexpr std::size_t kPerCell = kCoarse + 25;

struct Cell {
  double theta_low, theta_high, phi_low, phi_high;
  double error = 0;
  std::size_t values = 0;  ///< Offset of its integrals, one per channel.
  bool operator<(const Cell& other) const noexcept { return error < other.error; }
};

/// At a kink both rules err by like amounts, so that their difference says too little: up to 3.3 times
/// for a ring of one row, seen from the normal, where all azimuths err alike.
constexpr double kCautionAtKinks = 6;

bool has_kinks(const Brdf& brdf) {
  return dynamic_cast<const GridBrdf*>(&brdf) != nullptr ||
         dynamic_cast<const SpecularGridBrdf*>(&brdf) != nullptr;
}

class Cubature {
 public:
  Cubature(const Brdf& brdf, const Direction& omega_i)
      : brdf_(brdf),
        omega_i_(omega_i),
        channels_(brdf.channels()),
        caution_(has_kinks(brdf) ? kCautionAtKinks : 1),
        total_(channels_, 0.0),
        f_(kPerCell * channels_),
        coarse_(channels_) {}

  void add(Cell cell) {
    cell.values = values_.size();
    values_.resize(values_.size() + channels_);
    const std::span<double> fine(values_.data() + cell.values, channels_);
    place<3>(cell, kNode3, kWeight3, 0);
    place<5>(cell, kNode5, kWeight5, kCoarse);
    brdf_.eval_batch(omega_i_, omega_o_, f_, {});
    sum(0, kCoarse, coarse_);
    sum(kCoarse, kPerCell, fine);
    for (std::size_t c = 0; c < channels_; ++c) {
      cell.error = std::max(cell.error, caution_ * std::abs(fine[c] - coarse_[c]));
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
  /// Puts a rule's directions and weights behind the first ones.
  template <std::size_t N>
  void place(const Cell& cell, const std::array<double, N>& node, const std::array<double, N>& weight,
             std::size_t first) {
    const double half_theta = (cell.theta_high - cell.theta_low) / 2;
    const double half_phi = (cell.phi_high - cell.phi_low) / 2;
    const double side = brdf_.type() == ScatterType::kBtdf ? -1 : 1;
    for (std::size_t j = 0; j < N; ++j) {
      const double theta = cell.theta_low + half_theta * (1 + node[j]);
      for (std::size_t i = 0; i < N; ++i) {
        Direction& w = omega_o_[first + j * N + i];
        w = from_spherical(theta, cell.phi_low + half_phi * (1 + node[i]));
        share_[first + j * N + i] = weight[j] * weight[i] * half_theta * half_phi * w.z * std::sin(theta);
        w.z *= side;
      }
    }
  }

  void sum(std::size_t first, std::size_t end, std::span<double> out) const {
    std::ranges::fill(out, 0.0);
    for (std::size_t k = first; k < end; ++k) {
      for (std::size_t c = 0; c < channels_; ++c) {
        out[c] += share_[k] * f_[k * channels_ + c];
      }
    }
  }

  const Brdf& brdf_;
  Direction omega_i_;
  std::size_t channels_;
  double caution_;
  std::priority_queue<Cell> cells_;
  std::vector<double> values_;
  std::vector<double> total_;
  std::vector<double> f_;
  std::vector<double> coarse_;
  std::array<Direction, kPerCell> omega_o_;
  std::array<double, kPerCell> share_{};
  double error_ = 0;
  std::size_t evaluations_ = 0;
};

/// Distances from the mirror direction at which the first cells end [rad].
constexpr std::array<double, 6> kRings{0.001, 0.004, 0.016, 0.06, 0.25, 0.8};

/// Largest first cell [rad]: both rules would look past a feature much narrower than their nodes' distance,
/// and agree.
constexpr double kLargestCell = 0.1;
/// The same for grids, in their steps, and the smallest that this leads to [rad].
constexpr double kStepsPerCell = 3;
constexpr double kSmallestFirstCell = 0.02;

double first_cell(const Brdf& brdf) {
  double step = kLargestCell;
  const auto narrowest = [&](const std::vector<double>& axis) {
    for (std::size_t k = 1; k < axis.size(); ++k) {
      step = std::min(step, axis[k] - axis[k - 1]);
    }
  };
  if (const auto* grid = dynamic_cast<const GridBrdf*>(&brdf)) {
    step = std::min(grid->content().theta_step, grid->content().phi_step);
  } else if (const auto* specular = dynamic_cast<const SpecularGridBrdf*>(&brdf)) {
    narrowest(specular->content().radial);
  }
  return std::clamp(kStepsPerCell * step, kSmallestFirstCell, kLargestCell);
}

/// Break points that crowd around a centre, at most `widest` apart, clipped to [low, high].
std::vector<double> breaks(double centre, double low, double high, double widest) {
  std::vector<double> out{high};
  const auto count = static_cast<std::size_t>(std::ceil((high - low) / widest));
  for (std::size_t k = 0; k < count; ++k) {
    out.push_back(low + (high - low) * static_cast<double>(k) / static_cast<double>(count));
  }
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
  const double widest = first_cell(brdf);
  const auto theta = breaks(theta_mirror, 0, kPi / 2, widest);
  const auto phi = breaks(phi_mirror, phi_mirror - kPi, phi_mirror + kPi, widest);
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
