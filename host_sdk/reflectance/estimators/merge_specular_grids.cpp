#include <algorithm>
#include <cmath>
#include <optional>

#include "host_sdk/reflectance/estimators/estimator.h"
#include "host_sdk/reflectance/estimators/merge_kinds.h"
#include "host_sdk/reflectance/estimators/specular_nodes.h"
#include "host_sdk/reflectance/specular_grid_brdf.h"

namespace scatter::reflectance {
namespace {

const SpecularGridBrdf::Content& content_of(const MergeInput& input) {
  return static_cast<const SpecularGridBrdf*>(input.brdf)->content();
}

std::vector<double> joined(std::span<const MergeInput> inputs,
                           std::vector<double> SpecularGridBrdf::Content::* axis) {
  std::vector<double> all;
  for (const MergeInput& input : inputs) {
    const std::vector<double>& theirs = content_of(input).*axis;
    all.insert(all.end(), theirs.begin(), theirs.end());
  }
  std::ranges::sort(all);
  all.erase(std::unique(all.begin(), all.end(), [](double a, double b) { return b - a <= kSameAngle; }),
            all.end());
  return all;
}

/// For each angle of the result the source's own index, or nothing.
std::vector<std::optional<std::size_t>> own_indices(const std::vector<double>& wanted,
                                                    const std::vector<double>& own) {
  std::vector<std::optional<std::size_t>> found(wanted.size());
  for (std::size_t k = 0; k < wanted.size(); ++k) {
    const auto place = std::ranges::lower_bound(own, wanted[k] - kSameAngle);
    if (place != own.end() && *place <= wanted[k] + kSameAngle) {
      found[k] = static_cast<std::size_t>(place - own.begin());
    }
  }
  return found;
}

/// Puts a source's own nodes over its estimates, below the horizon too. Returns how many stayed estimates.
std::size_t put_own_nodes(const SpecularGridBrdf::Content& frame, std::size_t rotation, std::size_t incidence,
                          const MergeInput& input, std::span<const Direction> nodes, MergePlane& plane) {
  const SpecularGridBrdf::Content& own = content_of(input);
  const auto r = own_indices(frame.rotation, own.rotation)[rotation];
  const auto i = own_indices(frame.theta_i, own.theta_i)[incidence];
  if (!r || !i) {
    return nodes.size();
  }
  const auto azimuths = own_indices(frame.azimuth, own.azimuth);
  const auto radials = own_indices(frame.radial, own.radial);
  const double side = frame.type == ScatterType::kBrdf ? 1 : -1;
  std::size_t taken = 0;
  for (std::size_t n = 0; n < nodes.size(); ++n) {
    const auto azimuth = azimuths[n / frame.radial.size()];
    const auto radial = radials[n % frame.radial.size()];
    if (!azimuth || !radial) {
      continue;
    }
    taken += 1;
    const std::size_t at =
        ((*r * own.theta_i.size() + *i) * own.azimuth.size() + *azimuth) * own.radial.size() + *radial;
    plane.f[n] = own.f_per_sr[input.channel][at];
    plane.origin[n] = !own.origin.empty()      ? own.origin[at]
                      : side * nodes[n].z >= 0 ? Origin::kMeasured
                                               : Origin::kExtrapolated;
    if (own.sigma_per_sr.empty()) {
      plane.has_uncertainty = false;
    } else {
      plane.random[n] = 0;
      plane.systematic[n] = own.sigma_per_sr[input.channel][at];
    }
  }
  return nodes.size() - taken;
}

/// Stated totals, when every source has exactly the incidences of the result.
std::vector<std::vector<double>> stated_totals(const SpecularGridBrdf::Content& frame,
                                               std::span<const MergeInput> inputs) {
  std::vector<std::vector<double>> totals;
  for (const MergeInput& input : inputs) {
    const SpecularGridBrdf::Content& own = content_of(input);
    if (own.stated_total.empty() || own.theta_i.size() != frame.theta_i.size() ||
        own.rotation.size() != frame.rotation.size()) {
      return {};
    }
    totals.push_back(own.stated_total[input.channel]);
  }
  return totals;
}

}  // namespace

Result<Merged> merge_specular_grids(std::span<const MergeInput> inputs, MergeLabels labels) {
  using Content = SpecularGridBrdf::Content;
  Content content;
  content.type = inputs.front().brdf->type();
  content.plane_symmetric =
      std::ranges::all_of(inputs, [](const MergeInput& input) { return content_of(input).plane_symmetric; });
  content.wavelengths_nm = std::move(labels.wavelengths_nm);
  content.metadata = std::move(labels.metadata);
  content.rotation = joined(inputs, &Content::rotation);
  content.theta_i = joined(inputs, &Content::theta_i);
  content.azimuth = joined(inputs, &Content::azimuth);
  content.radial = joined(inputs, &Content::radial);
  content.stated_total = stated_totals(content, inputs);
  content.f_per_sr.resize(inputs.size());
  content.sigma_per_sr.resize(inputs.size());
  Merged merged;
  bool has_uncertainty = true;
  for (std::size_t r = 0; r < content.rotation.size(); ++r) {
    for (std::size_t i = 0; i < content.theta_i.size(); ++i) {
      const double phi_i = content.rotation[r];
      const std::vector<Direction> nodes = specular_nodes(content, content.theta_i[i], phi_i);
      std::vector<Origin> origin(nodes.size(), Origin::kMeasured);
      merged.points += nodes.size();
      for (std::size_t c = 0; c < inputs.size(); ++c) {
        MergePlane plane = estimated_plane(inputs[c], from_spherical(content.theta_i[i], phi_i), nodes);
        merged.estimated += put_own_nodes(content, r, i, inputs[c], nodes, plane);
        has_uncertainty = has_uncertainty && plane.has_uncertainty;
        content.f_per_sr[c].insert(content.f_per_sr[c].end(), plane.f.begin(), plane.f.end());
        for (std::size_t n = 0; n < nodes.size(); ++n) {
          content.sigma_per_sr[c].push_back(std::hypot(plane.random[n], plane.systematic[n]));
          origin[n] = combined(origin[n], plane.origin[n]);
        }
      }
      content.origin.insert(content.origin.end(), origin.begin(), origin.end());
    }
  }
  if (!has_uncertainty) {
    content.sigma_per_sr.clear();
  }
  Result<SpecularGridBrdf> made = SpecularGridBrdf::make(std::move(content));
  if (!made) {
    return std::unexpected(made.error());
  }
  merged.brdf = std::make_shared<const SpecularGridBrdf>(std::move(*made));
  return merged;
}

}  // namespace scatter::reflectance
