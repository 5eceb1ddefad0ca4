// Data whose true values are known, for the tests of this folder.
#pragma once

#include <cmath>
#include <functional>
#include <memory>
#include <random>
#include <utility>
#include <vector>

#include "host_sdk/reflectance/estimators/scattered_brdf.h"
#include "host_sdk/reflectance/grid_brdf.h"

namespace scatter::reflectance::made {

/// theta_i, theta_o, phi_o - phi_i -> f.
using Function = std::function<double(double theta_i, double theta_o, double phi)>;

struct Value {
  double f = -1;
  Origin origin = Origin::kInvalid;
};

inline Value at(const Brdf& brdf, const Direction& i, const Direction& o) {
  std::vector<double> f(brdf.channels(), -1);
  Value v;
  v.origin = brdf.eval(i, o, f);
  v.f = f[0];
  return v;
}
inline Direction deg(double theta, double phi) {
  return from_spherical(radians(theta), radians(phi));
}

/// Known everywhere above the horizon, measured there, with constant uncertainties when asked.
class FunctionBrdf final : public Brdf {
 public:
  explicit FunctionBrdf(Function f, double random = 0, double systematic = 0)
      : f_(std::move(f)), random_(random), systematic_(systematic) {}
  [[nodiscard]] ScatterType type() const noexcept override { return ScatterType::kBrdf; }
  [[nodiscard]] std::size_t channels() const noexcept override { return 1; }
  [[nodiscard]] std::span<const float> wavelengths_nm() const noexcept override { return {}; }
  [[nodiscard]] Origin eval(const Direction& i, const Direction& o,
                            std::span<double> f) const noexcept override {
    f[0] = i.z > 0 && o.z >= 0 ? f_(theta_of(i), theta_of(o), phi_of(o) - phi_of(i)) : 0.0;
    return i.z > 0 && o.z >= 0 ? Origin::kMeasured : Origin::kInvalid;
  }
  [[nodiscard]] bool uncertainty(const Direction&, const Direction&, std::span<double> random,
                                 std::span<double> systematic) const noexcept override {
    random[0] = random_;
    systematic[0] = systematic_;
    return random_ > 0;
  }

 private:
  Function f_;
  double random_;
  double systematic_;
};

/// 5 deg grid about the normal to theta_o = 75, one channel, light along x.
inline GridBrdf::Content grid_content(const std::vector<double>& theta_i_deg, const Function& f,
                                      std::size_t rows = 16) {
  GridBrdf::Content content;
  content.channels = 1;
  content.theta_count = rows;
  content.phi_count = 72;
  content.theta_step = radians(5);
  content.phi_step = radians(5);
  for (const double theta : theta_i_deg) {
    GridPart part;
    part.theta_i = radians(theta);
    const std::size_t nodes = rows * 72;
    part.origin.assign(nodes, Origin::kMeasured);
    part.f_per_sr.emplace_back(nodes);
    for (std::size_t n = 0; n < nodes; ++n) {
      part.f_per_sr[0][n] =
          static_cast<float>(f(part.theta_i, static_cast<double>(n / 72) * content.theta_step,
                               static_cast<double>(n % 72) * content.phi_step));
    }
    content.parts.push_back(std::move(part));
  }
  return content;
}
inline void add_uncertainty(GridBrdf::Content& content, float random, float systematic) {
  for (GridPart& part : content.parts) {
    part.random_per_sr.assign(content.channels, std::vector<float>(part.origin.size(), random));
    part.systematic_per_sr.assign(content.channels, std::vector<float>(part.origin.size(), systematic));
  }
}

/// Rings of samples as a goniometer takes them; one channel, light at phi_i.
inline ScatteredSamples rings(const std::vector<double>& theta_i_deg, const std::vector<double>& theta_o_deg,
                              double phi_step_deg, const Function& f, double phi_i_deg = 0) {
  ScatteredSamples samples;
  samples.channels = 1;
  for (const double theta_i : theta_i_deg) {
    for (const double theta_o : theta_o_deg) {
      for (double phi = 0; phi < 360 - 1e-9; phi += phi_step_deg) {
        samples.omega_i.push_back(deg(theta_i, phi_i_deg));
        samples.omega_o.push_back(deg(theta_o, phi));
        samples.f_per_sr.push_back(
            static_cast<float>(f(radians(theta_i), radians(theta_o), radians(phi - phi_i_deg))));
      }
    }
  }
  return samples;
}

/// Uniform over the sphere of directions with z > 0.
inline Direction random_direction(std::mt19937& random) {
  std::uniform_real_distribution<double> unit(0, 1);
  const double z = unit(random);
  const double phi = 2 * kPi * unit(random);
  const double s = std::sqrt(1 - z * z);
  return {s * std::cos(phi), s * std::sin(phi), z};
}

}  // namespace scatter::reflectance::made
