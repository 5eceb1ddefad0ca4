// What game engines and renderers will make of a measured material.
#pragma once

#include <stop_token>
#include <string>
#include <vector>

#include "host_sdk/error/error.h"
#include "host_sdk/formats/engine_material.h"
#include "host_sdk/reflectance/fitting/fit.h"

namespace scatter::cli {

/// A material and how far it is from the measurement when an engine evaluates it.
struct EngineFit {
  formats::EngineMaterial material;
  double rms_log_residual = 0;     ///< By solid angle, incidences alike.
  double mean_relative_error = 0;  ///< Likewise.
  double relative_flux_error = 0;  ///< Likewise.
  std::vector<reflectance::IncidenceLoss> incidences;
};

struct EngineFits {
  EngineFit core;      ///< Metallic-roughness with F0: what engines have in common.
  EngineFit gltf;      ///< With KHR_materials_specular too.
  EngineFit open_pbr;  ///< As core, judged with OpenPBR's layering.
};

/// Fits them to samples of one or three channels (three of known wavelengths: red is the longest).
/// Errors    kInvalidArgument: other channel counts; those of fit.
[[nodiscard]] Result<EngineFits> fit_engines(const reflectance::FitSamples& samples, const std::string& name,
                                             std::stop_token stop);

}  // namespace scatter::cli
