#include "host_sdk/reflectance/fitting/fit_samples.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "host_sdk/reflectance/grid_brdf.h"
#include "host_sdk/reflectance/inspection.h"
#include "host_sdk/reflectance/sampled_grid.h"
#include "host_sdk/reflectance/specular_grid_brdf.h"

namespace scatter::reflectance {
namespace {

/// Each incidence is sampled at every degree before the samples are thinned: few where channels are many.
std::size_t most_incidences(const Brdf& brdf, const GridLayout& layout) {
  constexpr std::size_t kMostValues = std::size_t{1} << 25;
  return std::clamp<std::size_t>(kMostValues / (layout.theta_count * layout.phi_count * brdf.channels()), 4,
                                 24);
}

bool wanted(Origin origin, const GatherOptions& options) {
  return origin == Origin::kMeasured || (options.region == Region::kAll && origin != Origin::kInvalid);
}

/// No instrument reads exactly nothing in every channel: files fill what was not measured with zeros.
template <typename Planes>
bool filled(const Planes& planes, std::size_t node) {
  return std::ranges::all_of(planes, [&](const auto& plane) { return plane[node] == 0; });
}

void open_incidence(FitSamples& out, double theta_i, double phi_i) {
  if (!out.incidences.empty() && out.incidences.back().count == 0) {
    out.incidences.pop_back();
  }
  out.incidences.push_back({theta_i, phi_i, out.size(), 0});
}

void add_direction(FitSamples& out, const Direction& omega_o, double solid_angle_sr) {
  out.omega_o.push_back(omega_o);
  out.solid_angle_sr.push_back(solid_angle_sr);
  ++out.incidences.back().count;
}

FitSamples from_grid(const GridBrdf& grid, const GatherOptions& options) {
  const GridBrdf::Content& content = grid.content();
  FitSamples out{.channels = content.channels, .wavelengths_nm = content.wavelengths_nm};
  const std::size_t nodes = content.theta_count * content.phi_count;
  const bool uncertain = std::ranges::all_of(content.parts, [](const GridPart& part) {
    return !part.random_per_sr.empty() || !part.systematic_per_sr.empty();
  });
  for (const GridPart& part : content.parts) {
    open_incidence(out, part.theta_i, part.phi_i);
    for (std::size_t node = 0; node < nodes; ++node) {
      const Direction omega_o = grid.omega_o(node);
      if (!wanted(part.origin[node], options) || !(omega_o.z > std::cos(options.theta_o_max)) ||
          filled(part.f_per_sr, node)) {
        continue;
      }
      add_direction(out, omega_o, grid.solid_angle_sr(node));
      for (std::size_t c = 0; c < content.channels; ++c) {
        out.f_per_sr.push_back(static_cast<double>(part.f_per_sr[c][node]));
        if (uncertain) {
          const auto of = [&](const auto& planes) {
            return planes.empty() ? 0.0 : static_cast<double>(planes[c][node]);
          };
          out.sigma_per_sr.push_back(std::hypot(of(part.random_per_sr), of(part.systematic_per_sr)));
        }
      }
    }
  }
  return out;
}

/// Borders of the cells of an axis: half-way to the neighbours, and the ends.
double cell_low(std::span<const double> axis, std::size_t k) {
  return k == 0 ? axis[0] : (axis[k - 1] + axis[k]) / 2;
}
double cell_high(std::span<const double> axis, std::size_t k) {
  return k + 1 == axis.size() ? axis[k] : (axis[k] + axis[k + 1]) / 2;
}

FitSamples from_specular_grid(const SpecularGridBrdf& grid, const GatherOptions& options) {
  const SpecularGridBrdf::Content& content = grid.content();
  FitSamples out{.channels = grid.channels(), .wavelengths_nm = content.wavelengths_nm};
  for (std::size_t r = 0; r < content.rotation.size(); ++r) {
    for (std::size_t i = 0; i < content.theta_i.size(); ++i) {
      const double sin_a = std::sin(content.theta_i[i]);
      const double cos_a = std::cos(content.theta_i[i]);
      const double cos_phi = std::cos(content.rotation[r]);
      const double sin_phi = std::sin(content.rotation[r]);
      open_incidence(out, content.theta_i[i], content.rotation[r]);
      for (std::size_t a = 0; a < content.azimuth.size(); ++a) {
        for (std::size_t k = 0; k < content.radial.size(); ++k) {
          const std::size_t node =
              ((r * content.theta_i.size() + i) * content.azimuth.size() + a) * content.radial.size() + k;
          const double x = std::sin(content.radial[k]) * std::cos(content.azimuth[a]);
          const double y = std::sin(content.radial[k]) * std::sin(content.azimuth[a]);
          const double z = std::cos(content.radial[k]);
          const Direction local{x * cos_a - z * sin_a, y, x * sin_a + z * cos_a};
          const Origin origin = content.origin.empty() ? Origin::kMeasured : content.origin[node];
          const double height =
              std::cos(cell_low(content.radial, k)) - std::cos(cell_high(content.radial, k));
          const double width = cell_high(content.azimuth, a) - cell_low(content.azimuth, a);
          const double solid_angle = height * width * (content.plane_symmetric ? 2 : 1);
          if (!wanted(origin, options) || !(local.z > std::cos(options.theta_o_max)) || !(solid_angle > 0) ||
              filled(content.f_per_sr, node)) {
            continue;
          }
          add_direction(
              out, {local.x * cos_phi - local.y * sin_phi, local.x * sin_phi + local.y * cos_phi, local.z},
              solid_angle);
          for (std::size_t c = 0; c < out.channels; ++c) {
            out.f_per_sr.push_back(static_cast<double>(content.f_per_sr[c][node]));
            if (!content.sigma_per_sr.empty()) {
              out.sigma_per_sr.push_back(static_cast<double>(content.sigma_per_sr[c][node]));
            }
          }
        }
      }
    }
  }
  return out;
}

Result<FitSamples> finished(FitSamples samples, const GatherOptions& options) {
  if (!samples.incidences.empty() && samples.incidences.back().count == 0) {
    samples.incidences.pop_back();
  }
  if (samples.size() == 0) {
    return fail(
        ErrorCode::kFailedPrecondition,
        fmt::format("no {} value within {:.0f} deg of the normal",
                    options.region == Region::kMeasured ? "measured" : "valid", degrees(options.theta_o_max)),
        options.region == Region::kMeasured
            ? "take interpolated and extrapolated values too, or measure again"
            : "check what the data hold with: scatter inspect FILE");
  }
  // An uncertainty of 0 is none: nothing can be weighted by it.
  if (std::ranges::any_of(samples.sigma_per_sr, [](double s) { return !(s > 0); })) {
    samples.sigma_per_sr.clear();
  }
  return options.max_samples == 0 ? std::move(samples) : thinned(samples, options.max_samples);
}

std::unexpected<Error> transmits() {
  return fail(ErrorCode::kInvalidArgument, "fit of a BTDF: the models describe reflection",
              "fit a BRDF; BTDF data can be converted, compared and interpolated");
}

/// Luminous share that makes a sample worth keeping: sum over channels of f cos, not negative.
double flux(const FitSamples& samples, std::size_t k) {
  double sum = 0;
  for (std::size_t c = 0; c < samples.channels; ++c) {
    sum += samples.f_per_sr[k * samples.channels + c];
  }
  return std::isfinite(sum) ? std::max(sum, 0.0) * samples.omega_o[k].z : 0.0;
}

void copy_sample(const FitSamples& from, std::size_t k, double scale, FitSamples& to) {
  add_direction(to, from.omega_o[k], from.solid_angle_sr[k] * scale);
  const auto values = [&](const std::vector<double>& in, std::vector<double>& out) {
    if (!in.empty()) {
      const auto first = in.begin() + static_cast<std::ptrdiff_t>(k * from.channels);
      out.insert(out.end(), first, first + static_cast<std::ptrdiff_t>(from.channels));
    }
  };
  values(from.f_per_sr, to.f_per_sr);
  values(from.sigma_per_sr, to.sigma_per_sr);
}

}  // namespace

Result<FitSamples> gather(const Brdf& brdf, const GatherOptions& options) {
  if (brdf.type() != ScatterType::kBrdf) {
    return transmits();
  }
  if (const auto* grid = dynamic_cast<const GridBrdf*>(&brdf)) {
    return finished(from_grid(*grid, options), options);
  }
  if (const auto* grid = dynamic_cast<const SpecularGridBrdf*>(&brdf)) {
    return finished(from_specular_grid(*grid, options), options);
  }
  GridLayout layout;
  if (const auto own = brdf.own_incidences(); !own.empty()) {
    layout.incidences.clear();
    for (const Direction& light : thinned(own, most_incidences(brdf, layout))) {
      layout.incidences.push_back({.rotation_rad = 0, .theta_i = theta_of(light), .phi_i = phi_of(light)});
    }
  }
  const auto sampled = sample_on_grid(brdf, layout);
  if (!sampled) {
    return std::unexpected(sampled.error());
  }
  GatherOptions all = options;
  all.region = Region::kAll;
  return finished(from_grid(*sampled, all), all);
}

Result<FitSamples> gather(const ScatteredSamples& samples, const GatherOptions& options) {
  if (const auto sound = check(samples); !sound) {
    return std::unexpected(sound.error());
  }
  if (samples.type != ScatterType::kBrdf) {
    return transmits();
  }
  constexpr double kSame = 1e-6;
  std::vector<std::size_t> order(samples.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  const auto key = [&](std::size_t k) {
    const Direction& w = samples.omega_i[k];
    return std::pair(std::lround(w.x / kSame), std::lround(w.y / kSame));
  };
  std::ranges::stable_sort(order, {}, key);
  FitSamples out{.channels = samples.channels, .wavelengths_nm = samples.wavelengths_nm};
  const bool uncertain = !samples.random_per_sr.empty() || !samples.systematic_per_sr.empty();
  std::pair<long, long> current{0, 0};
  for (const std::size_t k : order) {
    const Direction& omega_i = samples.omega_i[k];
    if (!wanted(samples.origin_of(k), options) || !(omega_i.z > 0) ||
        !(samples.omega_o[k].z > std::cos(options.theta_o_max))) {
      continue;
    }
    if (out.incidences.empty() || key(k) != current) {
      current = key(k);
      open_incidence(out, theta_of(omega_i), phi_of(omega_i));
    }
    add_direction(out, samples.omega_o[k], 1);
    for (std::size_t c = 0; c < samples.channels; ++c) {
      const std::size_t at = k * samples.channels + c;
      out.f_per_sr.push_back(static_cast<double>(samples.f_per_sr[at]));
      if (uncertain) {
        const auto of = [&](const auto& values) {
          return values.empty() ? 0.0 : static_cast<double>(values[at]);
        };
        out.sigma_per_sr.push_back(std::hypot(of(samples.random_per_sr), of(samples.systematic_per_sr)));
      }
    }
  }
  for (const FitSamples::Incidence& incidence : out.incidences) {
    for (std::size_t k = incidence.first; k < incidence.first + incidence.count; ++k) {
      out.solid_angle_sr[k] = 2 * kPi / static_cast<double>(incidence.count);
    }
  }
  return finished(std::move(out), options);
}

FitSamples thinned(const FitSamples& samples, std::size_t wanted_count) {
  if (samples.size() <= wanted_count) {
    return samples;
  }
  // Probability of staying, up to a factor: half by solid angle, half by flux, every incidence alike
  // in proportion to its samples.
  std::vector<double> chance(samples.size());
  for (const FitSamples::Incidence& incidence : samples.incidences) {
    double solid_angle = 0;
    double total = 0;
    for (std::size_t k = incidence.first; k < incidence.first + incidence.count; ++k) {
      solid_angle += samples.solid_angle_sr[k];
      total += samples.solid_angle_sr[k] * flux(samples, k);
    }
    for (std::size_t k = incidence.first; k < incidence.first + incidence.count; ++k) {
      const double even = samples.solid_angle_sr[k] / solid_angle;
      const double bright = total > 0 ? samples.solid_angle_sr[k] * flux(samples, k) / total : even;
      chance[k] = static_cast<double>(incidence.count) * (even + bright) / 2;
    }
  }
  double factor = static_cast<double>(wanted_count) / static_cast<double>(samples.size());
  for (int round = 0; round < 8; ++round) {  // chances above 1 are cut; the others share what is left
    double sum = 0;
    for (const double c : chance) {
      sum += std::min(c * factor, 1.0);
    }
    factor *= static_cast<double>(wanted_count) / sum;
  }
  FitSamples out{.channels = samples.channels, .wavelengths_nm = samples.wavelengths_nm};
  double due = 0.5;
  for (const FitSamples::Incidence& incidence : samples.incidences) {
    open_incidence(out, incidence.theta_i, incidence.phi_i);
    for (std::size_t k = incidence.first; k < incidence.first + incidence.count; ++k) {
      const double stays = std::min(chance[k] * factor, 1.0);
      due += stays;
      if (due >= 1) {
        due -= 1;
        copy_sample(samples, k, 1 / stays, out);
      }
    }
  }
  if (out.incidences.back().count == 0) {
    out.incidences.pop_back();
  }
  return out;
}

FitSamples only(const FitSamples& samples, const std::vector<bool>& keep) {
  FitSamples out{.channels = samples.channels, .wavelengths_nm = samples.wavelengths_nm};
  for (std::size_t i = 0; i < samples.incidences.size(); ++i) {
    if (keep[i]) {
      const FitSamples::Incidence& incidence = samples.incidences[i];
      open_incidence(out, incidence.theta_i, incidence.phi_i);
      for (std::size_t k = incidence.first; k < incidence.first + incidence.count; ++k) {
        copy_sample(samples, k, 1, out);
      }
    }
  }
  return out;
}

Status check(const FitSamples& samples) {
  const auto bad = [](const std::string& what) {
    return fail(ErrorCode::kInvalidArgument, "fit: " + what, "leave out what is not valid before fitting");
  };
  const std::size_t n = samples.size();
  const std::size_t values = n * samples.channels;
  if (samples.channels == 0 || samples.f_per_sr.size() != values || samples.solid_angle_sr.size() != n ||
      (!samples.sigma_per_sr.empty() && samples.sigma_per_sr.size() != values) ||
      (!samples.wavelengths_nm.empty() && samples.wavelengths_nm.size() != samples.channels)) {
    return bad(fmt::format(
        "{} directions, {} values, {} uncertainties, {} solid angles and {} channels do not agree", n,
        samples.f_per_sr.size(), samples.sigma_per_sr.size(), samples.solid_angle_sr.size(),
        samples.channels));
  }
  std::size_t next = 0;
  for (const FitSamples::Incidence& incidence : samples.incidences) {
    if (incidence.first != next || !(incidence.theta_i >= 0 && incidence.theta_i < kPi / 2) ||
        !std::isfinite(incidence.phi_i)) {
      return bad(fmt::format("incidence at sample {} (theta_i {} rad) is out of order or below the horizon",
                             incidence.first, incidence.theta_i));
    }
    next += incidence.count;
  }
  if (next != n) {
    return bad(fmt::format("the incidences have {} samples, but there are {}", next, n));
  }
  for (std::size_t k = 0; k < n; ++k) {
    const Direction& w = samples.omega_o[k];
    if (!(w.z > 0) || !(std::abs(dot(w, w) - 1) < 1e-5)) {
      return bad(
          fmt::format("sample {}: ({}, {}, {}) is no unit vector above the surface", k, w.x, w.y, w.z));
    }
    if (!(samples.solid_angle_sr[k] > 0) || !std::isfinite(samples.solid_angle_sr[k])) {
      return bad(fmt::format("sample {}: solid angle {} sr", k, samples.solid_angle_sr[k]));
    }
  }
  for (std::size_t k = 0; k < values; ++k) {
    if (!std::isfinite(samples.f_per_sr[k])) {
      return bad(fmt::format("sample {}, channel {}: value {}", k / samples.channels, k % samples.channels,
                             samples.f_per_sr[k]));
    }
    if (!samples.sigma_per_sr.empty() &&
        !(samples.sigma_per_sr[k] > 0 && std::isfinite(samples.sigma_per_sr[k]))) {
      return bad(fmt::format("sample {}, channel {}: uncertainty {}", k / samples.channels,
                             k % samples.channels, samples.sigma_per_sr[k]));
    }
  }
  return {};
}

}  // namespace scatter::reflectance
