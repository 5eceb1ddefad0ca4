#include <algorithm>
#include <cmath>
#include <optional>

#include "host_sdk/reflectance/estimators/estimator.h"
#include "host_sdk/reflectance/estimators/merge_kinds.h"
#include "host_sdk/reflectance/grid_brdf.h"

namespace scatter::reflectance {
namespace {

const GridBrdf& grid_of(const MergeInput& input) {
  return *static_cast<const GridBrdf*>(input.brdf);
}

bool same_incidence(const GridPart& a, const GridPart& b) {
  return std::abs(a.rotation_rad - b.rotation_rad) <= kSameAngle &&
         std::abs(a.theta_i - b.theta_i) <= kSameAngle &&
         (a.theta_i <= kSameAngle || std::abs(a.phi_i - b.phi_i) <= kSameAngle);
}

/// The finest steps and the largest range of all.
GridBrdf::Content frame_of(std::span<const MergeInput> inputs) {
  GridBrdf::Content frame;
  frame.theta_step = kPi;
  frame.phi_count = 0;
  double last_theta = 0;
  for (const MergeInput& input : inputs) {
    const GridBrdf::Content& content = grid_of(input).content();
    frame.theta_step = std::min(frame.theta_step, content.theta_step);
    frame.phi_count = std::max(frame.phi_count, content.phi_count);
    last_theta = std::max(last_theta, static_cast<double>(content.theta_count - 1) * content.theta_step);
    for (const GridPart& part : content.parts) {
      const bool known =
          std::ranges::any_of(frame.parts, [&](const GridPart& held) { return same_incidence(held, part); });
      if (!known) {
        GridPart added;
        added.rotation_rad = part.rotation_rad;
        added.theta_i = part.theta_i;
        added.phi_i = part.phi_i;
        frame.parts.push_back(std::move(added));
      }
    }
  }
  frame.type = grid_of(inputs.front()).type();
  frame.channels = inputs.size();
  frame.theta_count = static_cast<std::size_t>(std::floor(last_theta / frame.theta_step + 1e-6)) + 1;
  frame.phi_step = 2 * kPi / static_cast<double>(frame.phi_count);
  return frame;
}

/// Number of a source's row or column at a position, if it has one there.
std::optional<std::size_t> own_line(double angle, double step, std::size_t count) {
  const double nearest = std::round(angle / step);
  if (std::abs(angle / step - nearest) > 1e-6 || nearest >= static_cast<double>(count)) {
    return std::nullopt;
  }
  return static_cast<std::size_t>(nearest);
}

/// Puts a source's own nodes over its estimates. Returns how many nodes stayed estimates.
std::size_t put_own_nodes(const GridBrdf::Content& frame, const GridPart& wanted, const MergeInput& input,
                          MergePlane& plane) {
  const GridBrdf::Content& content = grid_of(input).content();
  const auto part =
      std::ranges::find_if(content.parts, [&](const GridPart& held) { return same_incidence(held, wanted); });
  const std::size_t nodes = frame.theta_count * frame.phi_count;
  if (part == content.parts.end()) {
    return nodes;
  }
  const std::size_t c = input.channel;
  std::size_t own = 0;
  for (std::size_t n = 0; n < nodes; ++n) {
    const auto row = own_line(static_cast<double>(n / frame.phi_count) * frame.theta_step, content.theta_step,
                              content.theta_count);
    const auto column = own_line(static_cast<double>(n % frame.phi_count) * frame.phi_step, content.phi_step,
                                 content.phi_count);
    if (!row || !column) {
      continue;
    }
    const std::size_t at = *row * content.phi_count + *column;
    if (part->origin[at] == Origin::kInvalid) {
      continue;
    }
    own += 1;
    plane.f[n] = part->f_per_sr[c][at];
    plane.origin[n] = part->origin[at];
    if (!part->random_per_sr.empty() && !part->systematic_per_sr.empty()) {
      plane.random[n] = part->random_per_sr[c][at];
      plane.systematic[n] = part->systematic_per_sr[c][at];
    } else {
      plane.has_uncertainty = false;
    }
  }
  return nodes - own;
}

}  // namespace

Result<Merged> merge_grids(std::span<const MergeInput> inputs, MergeLabels labels) {
  GridBrdf::Content content = frame_of(inputs);
  content.wavelengths_nm = std::move(labels.wavelengths_nm);
  content.metadata = std::move(labels.metadata);
  const std::size_t nodes = content.theta_count * content.phi_count;
  std::vector<Direction> omega_o(nodes);
  for (std::size_t n = 0; n < nodes; ++n) {
    omega_o[n] = from_spherical(static_cast<double>(n / content.phi_count) * content.theta_step,
                                static_cast<double>(n % content.phi_count) * content.phi_step);
    omega_o[n].z = content.type == ScatterType::kBtdf ? -omega_o[n].z : omega_o[n].z;
  }
  Merged merged;
  merged.points = nodes * content.parts.size();
  bool has_uncertainty = true;
  for (GridPart& part : content.parts) {
    part.origin.assign(nodes, Origin::kMeasured);
    for (const MergeInput& input : inputs) {
      MergePlane plane = estimated_plane(input, from_spherical(part.theta_i, part.phi_i), omega_o);
      merged.estimated += put_own_nodes(content, part, input, plane);
      has_uncertainty = has_uncertainty && plane.has_uncertainty;
      for (std::size_t n = 0; n < nodes; ++n) {
        part.origin[n] = combined(part.origin[n], plane.origin[n]);
      }
      part.f_per_sr.push_back(std::move(plane.f));
      part.random_per_sr.push_back(std::move(plane.random));
      part.systematic_per_sr.push_back(std::move(plane.systematic));
    }
  }
  if (!has_uncertainty) {
    for (GridPart& part : content.parts) {
      part.random_per_sr.clear();
      part.systematic_per_sr.clear();
    }
  }
  Result<GridBrdf> made = GridBrdf::make(std::move(content));
  if (!made) {
    return std::unexpected(made.error());
  }
  merged.brdf = std::make_shared<const GridBrdf>(std::move(*made));
  return merged;
}

}  // namespace scatter::reflectance
