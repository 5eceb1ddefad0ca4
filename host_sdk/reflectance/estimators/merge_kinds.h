// Merging, kind by kind; merge.h checks the sources and chooses.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "host_sdk/reflectance/estimators/merge.h"

namespace scatter::reflectance {

/// One source with what is needed of it.
struct MergeInput {
  const Brdf* brdf = nullptr;            ///< Of the kind that the function is for.
  std::shared_ptr<const Brdf> estimate;  ///< Its default chain.
  std::size_t channel = 0;
};

/// What the result says about itself.
struct MergeLabels {
  std::vector<float> wavelengths_nm;
  std::map<std::string, std::string> metadata;
};

[[nodiscard]] Result<Merged> merge_grids(std::span<const MergeInput> inputs, MergeLabels labels);
[[nodiscard]] Result<Merged> merge_specular_grids(std::span<const MergeInput> inputs, MergeLabels labels);
[[nodiscard]] Result<Merged> merge_samples(std::span<const MergeInput> inputs, MergeLabels labels);

/// Values, uncertainties and origins of one source at directions of one incidence.
struct MergePlane {
  std::vector<float> f, random, systematic;  ///< One per direction.
  std::vector<Origin> origin;
  bool has_uncertainty = true;
};
/// The source's estimate everywhere; at least kInterpolated.
[[nodiscard]] MergePlane estimated_plane(const MergeInput& input, const Direction& omega_i,
                                         std::span<const Direction> omega_o);

}  // namespace scatter::reflectance
