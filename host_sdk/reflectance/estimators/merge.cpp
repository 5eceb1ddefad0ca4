#include "host_sdk/reflectance/estimators/merge.h"

#include <fmt/format.h>

#include <algorithm>

#include "host_sdk/reflectance/estimators/chain.h"
#include "host_sdk/reflectance/estimators/merge_kinds.h"
#include "host_sdk/reflectance/estimators/scattered_brdf.h"
#include "host_sdk/reflectance/grid_brdf.h"
#include "host_sdk/reflectance/specular_grid_brdf.h"

namespace scatter::reflectance {
namespace {

enum class Kind : std::uint8_t { kGrid, kSpecularGrid, kSamples, kOther };

Kind kind_of(const Brdf& brdf) {
  if (dynamic_cast<const GridBrdf*>(&brdf) != nullptr) {
    return Kind::kGrid;
  }
  if (dynamic_cast<const SpecularGridBrdf*>(&brdf) != nullptr) {
    return Kind::kSpecularGrid;
  }
  return dynamic_cast<const ScatteredBrdf*>(&brdf) != nullptr ? Kind::kSamples : Kind::kOther;
}

const char* name_of(Kind kind) {
  switch (kind) {
    case Kind::kGrid:
      return "a grid about the normal";
    case Kind::kSpecularGrid:
      return "a grid about the specular direction";
    case Kind::kSamples:
      return "scattered samples";
    case Kind::kOther:
      break;
  }
  return "no measured points";
}

std::map<std::string, std::string> metadata_of(const Brdf& brdf) {
  if (const auto* grid = dynamic_cast<const GridBrdf*>(&brdf)) {
    return grid->content().metadata;
  }
  if (const auto* grid = dynamic_cast<const SpecularGridBrdf*>(&brdf)) {
    return grid->content().metadata;
  }
  if (const auto* samples = dynamic_cast<const ScatteredBrdf*>(&brdf)) {
    return samples->metadata();
  }
  return {};
}

MergeLabels labels_of(std::span<const MergeSource> sources) {
  MergeLabels labels;
  std::string names;
  bool wavelengths = true;
  const std::map<std::string, std::string> first = metadata_of(*sources.front().brdf);
  std::map<std::string, std::string> common = first;
  for (const MergeSource& source : sources) {
    const std::map<std::string, std::string> theirs = metadata_of(*source.brdf);
    std::erase_if(common, [&](const auto& entry) {
      const auto found = theirs.find(entry.first);
      return found == theirs.end() || found->second != entry.second;
    });
  }
  labels.metadata = common;
  for (const MergeSource& source : sources) {
    for (const auto& [key, value] : metadata_of(*source.brdf)) {
      if (!common.contains(key)) {
        labels.metadata[source.name + "." + key] = value;
      }
    }
    names += fmt::format("{}{}", names.empty() ? "" : ", ", source.name);
    const std::span<const float> known = source.brdf->wavelengths_nm();
    wavelengths = wavelengths && !known.empty();
    labels.wavelengths_nm.push_back(known.empty() ? 0.0F : known[source.channel]);
  }
  if (!wavelengths) {
    labels.wavelengths_nm.clear();
  }
  labels.metadata["merged_from"] = names;
  return labels;
}

Status check_source(const MergeSource& source, const MergeSource& first) {
  const Kind kind = kind_of(*source.brdf);
  if (kind == Kind::kOther) {
    return fail(ErrorCode::kInvalidArgument, fmt::format("merge: {} has {}", source.name, name_of(kind)),
                "convert it to a grid first");
  }
  if (kind != kind_of(*first.brdf)) {
    return fail(ErrorCode::kInvalidArgument,
                fmt::format("merge: {} is {}, {} is {}", first.name, name_of(kind_of(*first.brdf)),
                            source.name, name_of(kind)),
                "convert the files to one format first");
  }
  if (source.brdf->type() != first.brdf->type()) {
    return fail(ErrorCode::kInvalidArgument,
                fmt::format("merge: {} and {} are not both BRDF or both BTDF", first.name, source.name),
                "merge files of the same measurement");
  }
  if (source.channel >= source.brdf->channels()) {
    return fail(ErrorCode::kInvalidArgument,
                fmt::format("merge: {} has {} channels, channel {} was asked for", source.name,
                            source.brdf->channels(), source.channel),
                "choose a channel that is there, counted from 0");
  }
  return {};
}

}  // namespace

MergePlane estimated_plane(const MergeInput& input, const Direction& omega_i,
                           std::span<const Direction> omega_o) {
  MergePlane plane;
  const std::size_t n = input.estimate->channels();
  std::vector<double> f(omega_o.size() * n);
  plane.origin.resize(omega_o.size());
  input.estimate->eval_batch(omega_i, omega_o, f, plane.origin);
  plane.f.resize(omega_o.size());
  plane.random.assign(omega_o.size(), 0.0F);
  plane.systematic.assign(omega_o.size(), 0.0F);
  std::vector<double> random(n);
  std::vector<double> systematic(n);
  for (std::size_t k = 0; k < omega_o.size(); ++k) {
    plane.f[k] = static_cast<float>(f[k * n + input.channel]);
    plane.origin[k] = combined(plane.origin[k], Origin::kInterpolated);
    if (plane.origin[k] == Origin::kInvalid || !plane.has_uncertainty) {
      continue;
    }
    plane.has_uncertainty = input.estimate->uncertainty(omega_i, omega_o[k], random, systematic);
    plane.random[k] = static_cast<float>(random[input.channel]);
    plane.systematic[k] = static_cast<float>(systematic[input.channel]);
  }
  return plane;
}

Result<Merged> merge_channels(std::span<const MergeSource> sources) {
  if (sources.size() < 2) {
    return fail(ErrorCode::kInvalidArgument,
                fmt::format("merge: {} source, expected two or more", sources.size()),
                "name one file per colour");
  }
  std::vector<MergeInput> inputs;
  for (const MergeSource& source : sources) {
    if (Status status = check_source(source, sources.front()); !status) {
      return std::unexpected(status.error());
    }
    Result<Chain> chain = default_chain(source.brdf);
    if (!chain) {
      return std::unexpected(chain.error());
    }
    inputs.push_back({source.brdf.get(), chain->brdf, source.channel});
  }
  MergeLabels labels = labels_of(sources);
  switch (kind_of(*sources.front().brdf)) {
    case Kind::kGrid:
      return merge_grids(inputs, std::move(labels));
    case Kind::kSpecularGrid:
      return merge_specular_grids(inputs, std::move(labels));
    default:
      return merge_samples(inputs, std::move(labels));
  }
}

}  // namespace scatter::reflectance
