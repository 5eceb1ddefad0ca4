#include "host_sdk/reflectance/fitting/fit_data.h"

#include <algorithm>
#include <cmath>

#include "host_sdk/reflectance/fitting/fit_terms.h"

namespace scatter::reflectance {
namespace {

/// Median of the values; 0 of none. Reorders them.
double median(std::vector<double>& values) {
  if (values.empty()) {
    return 0;
  }
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::ranges::nth_element(values, middle);
  return *middle;
}

/// Half by solid angle, half by flux (if asked for), every incidence in proportion to its samples.
void set_weights(FitData& data, Weighting weighting, std::span<const double> flux) {
  if (weighting == Weighting::kEqual || data.residual == Residual::kUncertainty) {
    data.root_weight.assign(data.size(), 1.0);
    return;
  }
  for (const FitSamples::Incidence& incidence : data.incidences) {
    const std::size_t end = incidence.first + incidence.count;
    double solid_angle = 0;
    double total = 0;
    for (std::size_t k = incidence.first; k < end; ++k) {
      solid_angle += data.solid_angle_sr[k];
      total += data.solid_angle_sr[k] * flux[k];
    }
    const bool bright = weighting == Weighting::kSolidAngleAndFlux && total > 0;
    for (std::size_t k = incidence.first; k < end; ++k) {
      const double even = data.solid_angle_sr[k] / solid_angle;
      const double share = bright ? (even + data.solid_angle_sr[k] * flux[k] / total) / 2 : even;
      data.root_weight[k] = std::sqrt(share * static_cast<double>(incidence.count));
    }
  }
}

/// Model values of one channel at sample k from the sample's terms.
double combine(const double* term, const double* coefficient, std::size_t terms) {
  double sum = term[0];
  for (std::size_t j = 0; j < terms; ++j) {
    sum += coefficient[j] * term[1 + j];
  }
  return sum;
}

}  // namespace

std::vector<double> residual_floor(const FitSamples& samples) {
  std::vector<double> floor(samples.channels);
  std::vector<double> values;
  for (std::size_t c = 0; c < samples.channels; ++c) {
    values.clear();
    for (std::size_t k = 0; k < samples.size(); ++k) {
      const double f = samples.f_per_sr[k * samples.channels + c];
      if (f > 0) {
        values.push_back(f * samples.omega_o[k].z);
      }
    }
    floor[c] = 1e-3 * median(values);
    if (!samples.sigma_per_sr.empty()) {
      values.clear();
      for (std::size_t k = 0; k < samples.size(); ++k) {
        values.push_back(samples.sigma_per_sr[k * samples.channels + c] * samples.omega_o[k].z);
      }
      floor[c] = std::max(floor[c], 2 * median(values));
    }
  }
  // A channel without light is measured against the others.
  const double largest = *std::ranges::max_element(floor);
  for (double& e : floor) {
    e = e > 0 ? e : largest;
  }
  return floor;
}

double transformed(Residual residual, double floored) noexcept {
  return residual == Residual::kLog ? std::log(floored) : std::cbrt(floored);
}

double transformed_slope(Residual residual, double floored) noexcept {
  if (residual == Residual::kLog) {
    return 1 / floored;
  }
  const double root = std::cbrt(floored);
  return 1 / (3 * root * root);
}

FitData make_fit_data(const FitSamples& samples, Residual residual, Weighting weighting,
                      std::span<const double> floor) {
  const std::size_t n = samples.size();
  FitData data{.channels = samples.channels,
               .residual = residual,
               .incidences = samples.incidences,
               .geometry = {},
               .solid_angle_sr = samples.solid_angle_sr,
               .root_weight = std::vector<double>(n),
               .floor = {floor.begin(), floor.end()},
               .f_per_sr = std::vector<double>(n * samples.channels),
               .target = std::vector<double>(n * samples.channels),
               .inverse_sigma = {}};
  data.geometry.reserve(n);
  for (const FitSamples::Incidence& incidence : samples.incidences) {
    const Direction omega_i = from_spherical(incidence.theta_i, incidence.phi_i);
    for (std::size_t k = incidence.first; k < incidence.first + incidence.count; ++k) {
      data.geometry.push_back(formulas::make_geometry(omega_i, samples.omega_o[k]));
    }
  }
  if (residual == Residual::kUncertainty) {
    data.inverse_sigma.resize(n * samples.channels);
  }
  std::vector<double> flux(n, 0.0);
  for (std::size_t c = 0; c < samples.channels; ++c) {
    for (std::size_t k = 0; k < n; ++k) {
      const double f = samples.f_per_sr[k * samples.channels + c];
      const double weighted = f * samples.omega_o[k].z;
      flux[k] += std::max(weighted, 0.0);
      data.f_per_sr[c * n + k] = f;
      if (residual == Residual::kUncertainty) {
        data.inverse_sigma[c * n + k] = 1 / samples.sigma_per_sr[k * samples.channels + c];
      } else {
        // Noise may reach below -e, where the curve ends.
        data.target[c * n + k] = transformed(residual, std::max(weighted + floor[c], 0.1 * floor[c]));
      }
    }
  }
  set_weights(data, weighting, flux);
  return data;
}

void weigh_by_model(FitData& data, Weighting weighting, const FitFamily& family, const FitPoint& point) {
  if (weighting != Weighting::kSolidAngleAndFlux || data.residual == Residual::kUncertainty) {
    return;
  }
  const std::size_t terms = point.coefficient.size() / data.channels;
  std::vector<double> value(data.size() * (1 + terms));
  evaluate_terms(family, point.shape, data.geometry, value);
  std::vector<double> flux(data.size(), 0.0);
  for (std::size_t k = 0; k < data.size(); ++k) {
    for (std::size_t c = 0; c < data.channels; ++c) {
      flux[k] += combine(value.data() + k * (1 + terms), point.coefficient.data() + c * terms, terms) *
                 data.geometry[k].cos_o;
    }
  }
  set_weights(data, weighting, flux);
}

double rms_residual(const FitData& data, const FitFamily& family, const FitPoint& point) {
  const std::size_t n = data.size();
  const std::size_t terms = point.coefficient.size() / data.channels;
  std::vector<double> value(n * (1 + terms));
  evaluate_terms(family, point.shape, data.geometry, value);
  double sum = 0;
  double weight = 0;
  for (std::size_t c = 0; c < data.channels; ++c) {
    for (std::size_t k = 0; k < n; ++k) {
      const double m = combine(value.data() + k * (1 + terms), point.coefficient.data() + c * terms, terms);
      const double r = data.residual == Residual::kUncertainty
                           ? (m - data.f_per_sr[c * n + k]) * data.inverse_sigma[c * n + k]
                           : transformed(data.residual, m * data.geometry[k].cos_o + data.floor[c]) -
                                 data.target[c * n + k];
      const double w = data.root_weight[k] * data.root_weight[k];
      sum += w * r * r;
      weight += w;
    }
  }
  return std::sqrt(sum / weight);
}

}  // namespace scatter::reflectance
