#include "tools/scatter/engine_fit.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <numeric>
#include <utility>

#include "host_sdk/reflectance/fitting/open_pbr.h"

namespace scatter::cli {
namespace {

using reflectance::FitParameter;
using reflectance::FitResult;
using reflectance::FitSamples;

double shared(const FitResult& result, const std::string& name, double otherwise) {
  for (const FitParameter& parameter : result.parameters) {
    if (parameter.name == name && parameter.channel == FitParameter::kShared) {
      return parameter.value;
    }
  }
  return otherwise;
}

/// Channel numbers of red, green and blue.
std::array<std::size_t, 3> rgb_of(const FitSamples& samples) {
  if (samples.channels == 1) {
    return {0, 0, 0};
  }
  std::array<std::size_t, 3> order{0, 1, 2};
  if (samples.wavelengths_nm.size() == 3) {
    std::ranges::stable_sort(order, std::ranges::greater{},
                             [&](std::size_t c) { return samples.wavelengths_nm[c]; });
  }
  return order;
}

Status judge(const reflectance::Brdf& brdf, const FitSamples& samples, EngineFit& fit) {
  auto incidences = reflectance::losses(brdf, samples);
  if (!incidences) {
    return std::unexpected(incidences.error());
  }
  const double count = static_cast<double>(incidences->size());
  for (const auto& loss : *incidences) {
    fit.rms_log_residual += loss.rms_residual / count;
    fit.mean_relative_error += loss.mean_relative_error / count;
    fit.relative_flux_error += loss.relative_flux_error / count;
  }
  fit.incidences = std::move(*incidences);
  fit.material.comment =
      fmt::format("fitted to {} measured directions by OpenScatter; mean relative error {:.1f} %",
                  samples.size(), 100 * fit.mean_relative_error);
  return {};
}

Result<EngineFit> fitted(const FitSamples& samples, const char* family, const std::string& name,
                         std::stop_token stop) {
  const auto known = reflectance::fit_family(family);
  if (!known) {
    return std::unexpected(known.error());
  }
  const auto result = reflectance::fit(samples, *known, {.stop = std::move(stop)});
  if (!result) {
    return std::unexpected(result.error());
  }
  EngineFit out;
  out.material.name = name;
  const std::array<std::size_t, 3> rgb = rgb_of(samples);
  for (std::size_t c = 0; c < 3; ++c) {
    out.material.base_color[c] = result->model->parameters().coefficient[rgb[c]];
  }
  out.material.metallic = shared(*result, "metallic", 0);
  out.material.roughness = shared(*result, "roughness", 1);
  out.material.specular_factor = shared(*result, "specular", 1);
  out.material.ior = formats::ior_of_f0(shared(*result, "f0", 0.04));
  if (const auto judged = judge(*result->model, samples, out); !judged) {
    return std::unexpected(judged.error());
  }
  return out;
}

}  // namespace

Result<EngineFits> fit_engines(const FitSamples& samples, const std::string& name, std::stop_token stop) {
  if (samples.channels != 1 && samples.channels != 3) {
    return fail(ErrorCode::kInvalidArgument,
                fmt::format("{} channels, but engines have red, green and blue", samples.channels),
                "convert the data to three channels first");
  }
  auto core = fitted(samples, "metallic-roughness", name, stop);
  if (!core) {
    return std::unexpected(core.error());
  }
  auto gltf = fitted(samples, "gltf", name, stop);
  if (!gltf) {
    return std::unexpected(gltf.error());
  }
  EngineFits fits{.core = std::move(*core), .gltf = std::move(*gltf), .open_pbr = {}};
  const std::array<std::size_t, 3> rgb = rgb_of(samples);
  reflectance::OpenPbr::Parameters parameters{.base_color = std::vector<double>(samples.channels),
                                              .metalness = fits.core.material.metallic,
                                              .roughness = fits.core.material.roughness,
                                              .ior = fits.core.material.ior,
                                              .wavelengths_nm = samples.wavelengths_nm};
  for (std::size_t c = 0; c < 3; ++c) {
    parameters.base_color[rgb[c]] = fits.core.material.base_color[c];
  }
  const auto open_pbr = reflectance::OpenPbr(std::move(parameters)).recoloured(samples);
  if (!open_pbr) {
    return std::unexpected(open_pbr.error());
  }
  fits.open_pbr.material = fits.core.material;
  for (std::size_t c = 0; c < 3; ++c) {
    fits.open_pbr.material.base_color[c] = open_pbr->parameters().base_color[rgb[c]];
  }
  if (const auto judged = judge(*open_pbr, samples, fits.open_pbr); !judged) {
    return std::unexpected(judged.error());
  }
  return fits;
}

}  // namespace scatter::cli
