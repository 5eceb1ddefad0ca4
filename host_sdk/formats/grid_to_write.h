// Any BRDF as the grid that a file will hold. Internal to formats' writers.
#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "host_sdk/error/error.h"
#include "host_sdk/formats/save_brdf.h"
#include "host_sdk/reflectance/brdf.h"
#include "host_sdk/reflectance/grid_brdf.h"
#include "host_sdk/reflectance/sampled_grid.h"
#include "host_sdk/reflectance/specular_grid_brdf.h"

namespace scatter::formats {

using Metadata = std::map<std::string, std::string>;

/// Those of a grid or a list of samples, with the options' own on top; of a model only the latter.
[[nodiscard]] Metadata metadata_of(const reflectance::Brdf& brdf, const EncodeOptions& options);

/// Incidences that the data have, or the options ask for, or 0 10 .. 80 deg.
[[nodiscard]] std::vector<reflectance::GridLayout::Incidence> incidences_of(const reflectance::Brdf& brdf,
                                                                            const EncodeOptions& options);

/// Grid about the normal, metadata included: the data's own nodes when it is such a grid and the
/// options ask for nothing else (the result then points to `brdf`), else sampled.
/// Errors  kFailedPrecondition: scattered samples; kInvalidArgument: no such layout.
[[nodiscard]] Result<std::shared_ptr<const reflectance::GridBrdf>> normal_grid(const reflectance::Brdf& brdf,
                                                                               const EncodeOptions& options);

/// The same about the specular direction. Sampled nodes: azimuths 0..360 and radials from 0 to
/// where the last incidence's horizon ends, in the steps of the options. Below the horizon, and
/// where there is no value, the last value on the way from radial 0 (else the first one) stands,
/// with origin kInvalid. Only the first rotation's incidences count where those of others differ.
[[nodiscard]] Result<std::shared_ptr<const reflectance::SpecularGridBrdf>> specular_grid(
    const reflectance::Brdf& brdf, const EncodeOptions& options);

/// The same data with these channels only, metadata and all. `brdf` must outlive the result.
/// Errors  kInvalidArgument: no such channel.
[[nodiscard]] Result<std::shared_ptr<const reflectance::Brdf>> only_channels(
    const reflectance::Brdf& brdf, const std::vector<std::size_t>& chosen);

}  // namespace scatter::formats
