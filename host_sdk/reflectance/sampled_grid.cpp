#include "host_sdk/reflectance/sampled_grid.h"

#include <algorithm>

namespace scatter::reflectance {
namespace {

/// cos(90 deg) as rounded: the least that counts as above the horizon.
constexpr double kHorizon = 6e-17;

void fill(const Brdf& brdf, GridPart& part, const std::vector<Direction>& omega_o) {
  const std::size_t nodes = omega_o.size();
  const std::size_t channels = brdf.channels();
  const Direction omega_i = from_spherical(part.theta_i, part.phi_i);
  std::vector<double> f(nodes * channels);
  part.origin.resize(nodes);
  brdf.eval_batch(omega_i, omega_o, f, part.origin);
  part.f_per_sr.assign(channels, std::vector<float>(nodes));
  std::vector<double> random(channels);
  std::vector<double> systematic(channels);
  std::vector<std::vector<float>> random_planes(channels, std::vector<float>(nodes));
  std::vector<std::vector<float>> systematic_planes = random_planes;
  bool known = true;
  for (std::size_t n = 0; n < nodes; ++n) {
    for (std::size_t c = 0; c < channels; ++c) {
      part.f_per_sr[c][n] = static_cast<float>(f[n * channels + c]);
    }
    if (known && part.origin[n] != Origin::kInvalid) {
      known = brdf.uncertainty(omega_i, omega_o[n], random, systematic);
      for (std::size_t c = 0; known && c < channels; ++c) {
        random_planes[c][n] = static_cast<float>(random[c]);
        systematic_planes[c][n] = static_cast<float>(systematic[c]);
      }
    }
  }
  if (known) {
    part.random_per_sr = std::move(random_planes);
    part.systematic_per_sr = std::move(systematic_planes);
  }
}

}  // namespace

GridLayout GridLayout::of(const GridBrdf& grid) {
  const GridBrdf::Content& content = grid.content();
  GridLayout layout;
  layout.incidences.clear();
  for (const GridPart& part : content.parts) {
    layout.incidences.push_back({part.rotation_rad, part.theta_i, part.phi_i});
  }
  layout.theta_count = content.theta_count;
  layout.phi_count = content.phi_count;
  layout.theta_step = content.theta_step;
  return layout;
}

Result<GridBrdf> sample_on_grid(const Brdf& brdf, const GridLayout& layout) {
  GridBrdf::Content content;
  content.type = brdf.type();
  content.channels = brdf.channels();
  content.wavelengths_nm.assign(brdf.wavelengths_nm().begin(), brdf.wavelengths_nm().end());
  content.theta_count = layout.theta_count;
  content.phi_count = layout.phi_count;
  content.theta_step = layout.theta_step;
  content.phi_step = 2 * kPi / static_cast<double>(layout.phi_count == 0 ? 1 : layout.phi_count);
  std::vector<Direction> omega_o;
  omega_o.reserve(layout.theta_count * layout.phi_count);
  for (std::size_t n = 0; n < layout.theta_count * layout.phi_count; ++n) {
    Direction w = from_spherical(static_cast<double>(n / layout.phi_count) * content.theta_step,
                                 static_cast<double>(n % layout.phi_count) * content.phi_step);
    // Rounding must not put the row at 90 deg below the horizon, where nothing has a value.
    w.z = std::max(w.z, kHorizon);
    w.z = content.type == ScatterType::kBtdf ? -w.z : w.z;
    omega_o.push_back(w);
  }
  for (const GridLayout::Incidence& incidence : layout.incidences) {
    GridPart part;
    part.rotation_rad = incidence.rotation_rad;
    part.theta_i = incidence.theta_i;
    part.phi_i = incidence.phi_i;
    fill(brdf, part, omega_o);
    content.parts.push_back(std::move(part));
  }
  return GridBrdf::make(std::move(content));
}

}  // namespace scatter::reflectance
