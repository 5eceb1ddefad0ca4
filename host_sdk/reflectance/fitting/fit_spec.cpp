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

/// One lobe as a model of its own; p is its first shape parameter and moves behind its last.
std::string lobe_spec(const FittedBrdf::Parameters& parameters, std::size_t lobe, std::size_t& p) {
  const bool weighted = parameters.family.lobes.size() > 1;
  const double width = parameters.shape[p++];
  const std::string colour = values(parameters, 1 + lobe);
  const auto facets = [&](const char* model) {
    std::string text = fmt::format("{}:alpha={:.12g},f0={}", model, width, colour);
    if (weighted) {
      text += fmt::format(",weight={:.12g}", parameters.shape[p++]);
    }
    return text;
  };
  switch (parameters.family.lobes[lobe]) {
    case FitLobe::kGgx:
      return facets("ggx");
    case FitLobe::kBeckmann:
      return facets("beckmann");
    case FitLobe::kCookTorrance:
      return fmt::format("cook-torrance:m={:.12g},f0={},ks={:.12g}", width, colour, parameters.shape[p++]);
    case FitLobe::kWard:
      return fmt::format("ward:alpha={:.12g},ks={}", width, colour);
    case FitLobe::kLafortune:
      break;
  }
  return fmt::format("lafortune:n={:.12g},ks={}", width, colour);
}

}  // namespace

std::string model_spec(const FittedBrdf::Parameters& parameters) {
  const FitFamily& family = parameters.family;
  if (parameters.channels != 1 && parameters.channels != 3) {
    return {};
  }
  if (family.whole == FitWhole::kGltf || family.whole == FitWhole::kMetallicRoughness) {
    return {};
  }
  if (family.whole == FitWhole::kDisney) {
    return fmt::format("disney:base={},roughness={:.12g},metallic={:.12g},specular={:.12g}",
                       values(parameters, 0), parameters.shape[0], parameters.shape[1], parameters.shape[2]);
  }
  const bool lambert = family.base == FitBase::kLambert;
  std::size_t p = lambert ? 0 : 1;
  std::string base =
      lambert ? fmt::format("lambertian:albedo={}", values(parameters, 0))
              : fmt::format("oren-nayar:albedo={},sigma={:.12g}", values(parameters, 0), parameters.shape[0]);
  if (family.lobes.empty()) {
    return base;
  }
  if (lambert && family.lobes.size() == 1) {
    return fmt::format("{},albedo={}", lobe_spec(parameters, 0, p), values(parameters, 0));
  }
  std::string text = fmt::format("sum:{}", base);
  for (std::size_t lobe = 0; lobe < family.lobes.size(); ++lobe) {
    text += ',';
    text += lobe_spec(parameters, lobe, p);
  }
  return text;
}

}  // namespace scatter::reflectance
