#include "host_sdk/reflectance/scattered_samples.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

namespace scatter::reflectance {
namespace {

/// Largest difference of a direction's length from 1: what rounding to float leaves, and no more.
constexpr double kUnitTolerance = 1e-6;

std::unexpected<Error> bad(const std::string& what) {
  return fail(ErrorCode::kInvalidArgument, "samples: " + what,
              "give every sample two unit vectors and finite values");
}

bool is_unit(const Direction& w) {
  return std::abs(std::sqrt(dot(w, w)) - 1) <= kUnitTolerance;
}

Status check_directions(const ScatteredSamples& samples) {
  const double side = samples.type == ScatterType::kBrdf ? 1 : -1;
  for (std::size_t s = 0; s < samples.size(); ++s) {
    const Direction& i = samples.omega_i[s];
    const Direction& o = samples.omega_o[s];
    if (!is_unit(i) || !(i.z > 0)) {
      return bad(
          fmt::format("omega_i {} is ({}, {}, {}), expected a unit vector with z > 0", s, i.x, i.y, i.z));
    }
    if (!is_unit(o) || !(side * o.z >= -kUnitTolerance)) {
      return bad(fmt::format("omega_o {} is ({}, {}, {}), expected a unit vector with z {} 0", s, o.x, o.y,
                             o.z, side > 0 ? ">=" : "<="));
    }
  }
  return {};
}

Status check_values(const ScatteredSamples& samples, const std::vector<float>& values, bool is_uncertainty,
                    const char* name) {
  const std::size_t expected = samples.size() * samples.channels;
  if (is_uncertainty && values.empty()) {
    return {};
  }
  if (values.size() != expected) {
    return bad(fmt::format("{} has {} numbers, expected {} x {} = {}", name, values.size(), samples.size(),
                           samples.channels, expected));
  }
  for (std::size_t k = 0; k < values.size(); ++k) {
    const bool good = std::isfinite(values[k]) && (!is_uncertainty || values[k] >= 0);
    if (!good && samples.origin_of(k / samples.channels) != Origin::kInvalid) {
      return bad(fmt::format("{}, sample {}, channel {} is {}, expected a finite number{}", name,
                             k / samples.channels, k % samples.channels, values[k],
                             is_uncertainty ? " >= 0" : ""));
    }
  }
  return {};
}

}  // namespace

Status check(const ScatteredSamples& samples) {
  if (samples.channels == 0) {
    return bad("0 channels, expected at least 1");
  }
  if (!samples.wavelengths_nm.empty() && samples.wavelengths_nm.size() != samples.channels) {
    return bad(fmt::format("{} wavelengths, expected {}", samples.wavelengths_nm.size(), samples.channels));
  }
  if (samples.omega_o.size() != samples.size()) {
    return bad(
        fmt::format("{} omega_o for {} omega_i, expected as many", samples.omega_o.size(), samples.size()));
  }
  if (!samples.origin.empty() && samples.origin.size() != samples.size()) {
    return bad(fmt::format("{} origins, expected {}", samples.origin.size(), samples.size()));
  }
  if (std::ranges::any_of(samples.origin, [](Origin o) { return o > Origin::kExtrapolated; })) {
    return bad("an origin is above 3");
  }
  if (Status status = check_directions(samples); !status) {
    return status;
  }
  if (Status status = check_values(samples, samples.f_per_sr, false, "f"); !status) {
    return status;
  }
  if (Status status = check_values(samples, samples.random_per_sr, true, "random uncertainty"); !status) {
    return status;
  }
  return check_values(samples, samples.systematic_per_sr, true, "systematic uncertainty");
}

std::vector<Direction> incidences_of(const ScatteredSamples& samples) {
  constexpr double kSame = 1e-5;
  // By the place in the tangent plane: there the azimuth of light along the normal says nothing.
  std::map<std::pair<long, long>, Direction> distinct;
  for (std::size_t s = 0; s < samples.size(); ++s) {
    const Direction& w = samples.omega_i[s];
    if (samples.origin_of(s) != Origin::kInvalid && w.z > kSame) {
      distinct.try_emplace({std::lround(w.x / kSame), std::lround(w.y / kSame)}, w);
    }
  }
  std::vector<Direction> out;
  for (const auto& entry : distinct) {
    out.push_back(entry.second);
  }
  std::ranges::stable_sort(out, [&](const Direction& a, const Direction& b) {
    const double difference = theta_of(a) - theta_of(b);
    return std::abs(difference) > kSame ? difference < 0 : phi_of(a) < phi_of(b);
  });
  return out;
}

}  // namespace scatter::reflectance
