// Samples of known materials, with and without noise.
#pragma once

#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include "host_sdk/reflectance/fitting/fit_samples.h"
#include "host_sdk/reflectance/models/model_spec.h"

namespace scatter::reflectance::test {

inline const std::vector<double> kInstrumentDeg{0, 20, 40, 60};

/// `count` directions per incidence, even in solid angle up to 75 deg (a spiral), of a model spec.
inline FitSamples samples_of(const std::string& spec, std::size_t count,
                             const std::vector<double>& incidences_deg = kInstrumentDeg) {
  const auto brdf = make_model(spec).value();
  FitSamples samples{.channels = brdf->channels()};
  const double lowest = std::cos(radians(75));
  for (const double theta_deg : incidences_deg) {
    const double theta_i = radians(theta_deg);
    samples.incidences.push_back({theta_i, 0.3, samples.size(), count});
    for (std::size_t k = 0; k < count; ++k) {
      const double z = 1 - (1 - lowest) * (static_cast<double>(k) + 0.5) / static_cast<double>(count);
      const Direction omega_o = from_spherical(std::acos(z), 2.39996322972865332 * static_cast<double>(k));
      std::vector<double> f(samples.channels);
      (void)brdf->eval(from_spherical(theta_i, 0.3), omega_o, f);
      samples.omega_o.push_back(omega_o);
      samples.solid_angle_sr.push_back(2 * kPi * (1 - lowest) / static_cast<double>(count));
      samples.f_per_sr.insert(samples.f_per_sr.end(), f.begin(), f.end());
    }
  }
  return samples;
}

/// Normal noise: relative * f and additive [1/sr], independent everywhere.
inline void add_noise(FitSamples& samples, double relative, double additive_per_sr, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  for (double& f : samples.f_per_sr) {
    const double a = normal(random);
    const double b = normal(random);
    f += relative * f * a + additive_per_sr * b;
  }
}

}  // namespace scatter::reflectance::test
