#include "host_sdk/reflectance/fitting/fitted_brdf.h"

#include <algorithm>
#include <array>
#include <utility>

#include "host_sdk/reflectance/fitting/fit_terms.h"

namespace scatter::reflectance {
namespace {

constexpr std::size_t kBlock = 128;    // geometries at a time: 17 kB of stack
constexpr std::size_t kMostTerms = 4;  // rest, base, two lobes

}  // namespace

FittedBrdf::FittedBrdf(Parameters parameters) : parameters_(std::move(parameters)) {}

Origin FittedBrdf::eval(const Direction& omega_i, const Direction& omega_o,
                        std::span<double> f_per_sr) const noexcept {
  Origin origin = Origin::kInvalid;
  eval_batch(omega_i, {&omega_o, 1}, f_per_sr, {&origin, 1});
  return origin;
}

void FittedBrdf::eval_batch(const Direction& omega_i, std::span<const Direction> omega_o,
                            std::span<double> f_per_sr, std::span<Origin> origin) const noexcept {
  const std::size_t channels = parameters_.channels;
  const std::size_t terms = parameters_.coefficient.size() / channels;
  const std::size_t stride = 1 + terms;
  std::array<formulas::Geometry, kBlock> geometry;
  std::array<double, kBlock * kMostTerms> value;
  for (std::size_t first = 0; first < omega_o.size(); first += kBlock) {
    const std::size_t count = std::min(kBlock, omega_o.size() - first);
    for (std::size_t k = 0; k < count; ++k) {
      const Direction& out = omega_o[first + k];
      const bool valid = omega_i.z > 0 && out.z > 0;
      geometry[k] = valid ? formulas::make_geometry(omega_i, out) : formulas::Geometry{};
    }
    evaluate_terms(parameters_.family, parameters_.shape, {geometry.data(), count}, value);
    for (std::size_t k = 0; k < count; ++k) {
      const bool valid = omega_i.z > 0 && omega_o[first + k].z > 0;
      const double* term = value.data() + k * stride;
      double* f = f_per_sr.data() + (first + k) * channels;
      for (std::size_t c = 0; c < channels; ++c) {
        const double* coefficient = parameters_.coefficient.data() + c * terms;
        double sum = term[0];
        for (std::size_t j = 0; j < terms; ++j) {
          sum += coefficient[j] * term[1 + j];
        }
        f[c] = valid ? sum : 0.0;
      }
      if (!origin.empty()) {
        origin[first + k] = valid ? Origin::kInterpolated : Origin::kInvalid;
      }
    }
  }
}

}  // namespace scatter::reflectance
