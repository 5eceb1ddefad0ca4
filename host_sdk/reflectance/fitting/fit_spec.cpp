#include "host_sdk/reflectance/fitting/fit_spec.h"

#include <fmt/format.h>

#include <cstddef>

#include "host_sdk/reflectance/fitting/fit_terms.h"

namespace scatter::reflectance {
namespace {

/// One number, or three with slashes; 12 digits, so that reading it back changes nothing that matters.
std::string values(const FittedBrdf::Parameters& parameters, std::size_t term) {
  const std::size_t terms = coefficients(parameters.family).size();
  std::string text;
  for (std::size_t c = 0; c < parameters.channels; ++c) {
    text += fmt::format("{}{:.12g}", c == 0 ? "" : "/", parameters.coefficient[c * terms + term]);
  }
  return text;
}

}  // namespace

std::string model_spec(const FittedBrdf::Parameters& parameters) {
  if (parameters.channels != 1 && parameters.channels != 3) {
    return {};
  }
  if (parameters.family == FitFamily{}) {
    return "lambertian:" + values(parameters, 0);
  }
  if (parameters.family == FitFamily{.lobes = {FitLobe::kGgx}}) {
    return fmt::format("ggx:alpha={:.12g},f0={},albedo={}", parameters.shape[0], values(parameters, 1),
                       values(parameters, 0));
  }
  return {};
}

}  // namespace scatter::reflectance
