#include "host_sdk/reflectance/adapted_brdf.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "host_sdk/reflectance/grid_brdf.h"
#include "host_sdk/reflectance/normals_estimate.h"
#include "host_sdk/reflectance/specular_grid_brdf.h"

namespace scatter::reflectance {
namespace {

constexpr std::size_t kGridAzimuths = 17;
constexpr std::size_t kMostIncidences = 256;
/// Own incidences this close to a default one replace it [rad].
constexpr double kClose = radians(3);
/// BT.709 luminance of linear red, green and blue.
constexpr std::array<double, 3> kLuminance{0.2126, 0.7152, 0.0722};
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

/// Incidences and whether there are several sample rotations, of a grid.
struct Own {
  std::vector<double> theta_i;
  bool rotated = false;
  const std::map<std::string, std::string>* metadata = nullptr;
};

Own own_of(const Brdf& brdf) {
  Own own;
  if (const auto* grid = dynamic_cast<const GridBrdf*>(&brdf)) {
    for (const GridPart& part : grid->content().parts) {
      own.theta_i.push_back(part.theta_i);
      own.rotated = own.rotated || part.rotation_rad != grid->content().parts.front().rotation_rad;
    }
    own.metadata = &grid->content().metadata;
  } else if (const auto* specular = dynamic_cast<const SpecularGridBrdf*>(&brdf)) {
    own.theta_i = specular->content().theta_i;
    own.rotated = specular->content().rotation.size() > 1;
    own.metadata = &specular->content().metadata;
  }
  std::ranges::sort(own.theta_i);
  return own;
}

std::vector<double> incidences(const Own& own) {
  std::vector<double> theta_i = own.theta_i;
  for (const double deg : {0, 10, 20, 30, 40, 50, 60, 70, 80, 89}) {
    if (std::ranges::none_of(own.theta_i, [&](double t) { return std::abs(t - radians(deg)) < kClose; })) {
      theta_i.push_back(radians(deg));
    }
  }
  std::ranges::sort(theta_i);
  const auto repeated =
      std::ranges::unique(theta_i, [](double a, double b) { return std::abs(a - b) < radians(0.05); });
  theta_i.erase(repeated.begin(), repeated.end());
  return theta_i;
}

/// Density of normals visible from one incidence, per area of the square; sums to 1 over the nodes.
void fill_vndf(const NormalsEstimate& normals, const Direction& omega_i, std::size_t side, float* out) {
  double sum = 0;
  for (std::size_t r = 0; r < side; ++r) {
    for (std::size_t c = 0; c < side; ++c) {
      const SquarePoint u{static_cast<double>(c) / static_cast<double>(side - 1),
                          static_cast<double>(r) / static_cast<double>(side - 1)};
      const double theta = theta_at(u.x);
      const Direction m = from_spherical(theta, phi_at(u.y));
      const BilinearTables& ndf = normals.ndf;
      const double d = bilinear(ndf.values.data(), ndf.width, cell_at(ndf.width, ndf.height, u));
      const double value = d * std::max(0.0, dot(m, omega_i)) * u.x * std::sin(theta);
      out[r * side + c] = static_cast<float>(value);
      sum += value;
    }
  }
  for (std::size_t k = 0; k < side * side && sum > 0; ++k) {
    out[k] = static_cast<float>(static_cast<double>(out[k]) / sum);
  }
}

/// Values of one incidence at the nodes, f without the cosine; NaN where there is none.
struct Slice {
  std::vector<double> f;       ///< [channel][node]
  std::vector<double> cosine;  ///< Of omega_o, negative below the horizon.
  std::vector<double> factor;  ///< What f cos(theta_o) is divided by before it is stored.
};

Slice evaluate(const Brdf& brdf, const AdaptiveBrdf::Content& content, const BilinearWarp& vndf,
               std::size_t table, const Direction& omega_i) {
  const std::size_t side = content.spectra.width;
  const std::size_t nodes = side * side;
  const std::size_t channels = content.channels;
  const TableMix mix{.table = {table}, .weight = {1}, .count = 1};
  const auto value = [](const BilinearTables& tables, const SquarePoint& at) {
    return bilinear(tables.values.data(), tables.width, cell_at(tables.width, tables.height, at));
  };
  const auto square_y = [](double phi) { return phi / (2 * kPi) + 0.5; };
  const double sigma = value(
      content.sigma, {std::sqrt(theta_of(omega_i) / (kPi / 2)), square_y(std::atan2(omega_i.y, omega_i.x))});
  Slice slice{std::vector<double>(nodes * channels, kNaN), std::vector<double>(nodes),
              std::vector<double>(nodes)};
  std::vector<Direction> omega_o(nodes);
  for (std::size_t n = 0; n < nodes; ++n) {
    const SquarePoint s{static_cast<double>(n % side) / static_cast<double>(side - 1),
                        static_cast<double>(n / side) / static_cast<double>(side - 1)};
    const SquarePoint u = vndf.sample(s, mix);
    const Direction m = from_spherical(theta_at(u.x), phi_at(u.y));
    const double twice = 2 * dot(omega_i, m);
    omega_o[n] = {twice * m.x - omega_i.x, twice * m.y - omega_i.y, twice * m.z - omega_i.z};
    slice.cosine[n] = omega_o[n].z;
    slice.factor[n] = value(content.ndf, u) / (4 * sigma);
  }
  std::vector<double> f(nodes * channels);
  std::vector<Origin> origin(nodes);
  brdf.eval_batch(omega_i, omega_o, f, origin);
  for (std::size_t n = 0; n < nodes; ++n) {
    if (slice.cosine[n] > 0 && origin[n] != Origin::kInvalid) {
      for (std::size_t c = 0; c < channels; ++c) {
        slice.f[c * nodes + n] = f[n * channels + c];
      }
    }
  }
  return slice;
}

/// Gives nodes without a value that of their neighbours, ring by ring; the first and the last row
/// are the same azimuth. False when no node has one.
bool extend(std::span<double> f, std::size_t side) {
  const auto nodes = static_cast<std::size_t>(f.size());
  std::size_t missing = 0;
  for (const double v : f) {
    missing += std::isnan(v);
  }
  while (missing > 0 && missing < nodes) {
    std::vector<std::pair<std::size_t, double>> found;
    for (std::size_t n = 0; n < nodes; ++n) {
      if (!std::isnan(f[n])) {
        continue;
      }
      const std::size_t row = n / side;
      const std::size_t column = n % side;
      double sum = 0;
      int count = 0;
      const auto add = [&](std::size_t r, std::size_t c) {
        if (!std::isnan(f[r * side + c])) {
          sum += f[r * side + c];
          ++count;
        }
      };
      add(row > 0 ? row - 1 : side - 2, column);
      add(row + 1 < side ? row + 1 : 1, column);
      if (column > 0) {
        add(row, column - 1);
      }
      if (column + 1 < side) {
        add(row, column + 1);
      }
      if (count > 0) {
        found.emplace_back(n, sum / count);
      }
    }
    for (const auto& [n, value] : found) {
      f[n] = value;
    }
    missing -= found.size();
  }
  return missing == 0;
}

Status check(const Brdf& brdf, const AdaptOptions& options) {
  const auto bad = [](const std::string& what, const char* remedy) {
    return fail(ErrorCode::kInvalidArgument, fmt::format("adaptive form: {}", what), remedy);
  };
  if (brdf.type() != ScatterType::kBrdf) {
    return bad("the data are a BTDF, half vectors of reflection do not describe them",
               "write another format");
  }
  if (options.resolution < 4 || options.resolution > 256 || options.normals_resolution < 16 ||
      options.normals_resolution > 512 ||
      (options.azimuths > 1 && (options.azimuths < 5 || options.azimuths > 361))) {
    return bad(fmt::format("resolution {}, normals {}, azimuths {}; expected 4..256, 16..512, 0, 1 or 5..361",
                           options.resolution, options.normals_resolution, options.azimuths),
               "choose other resolutions");
  }
  for (std::size_t k = 0; k < options.theta_i.size(); ++k) {
    const double theta = options.theta_i[k];
    if (!(theta >= 0 && theta < kPi / 2) || (k > 0 && !(theta > options.theta_i[k - 1])) ||
        options.theta_i.size() > kMostIncidences) {
      return bad(
          fmt::format("incidence {} of {} is {} rad, expected at most {}, ascending, from 0 to below pi/2", k,
                      options.theta_i.size(), theta, kMostIncidences),
          "choose other incidences");
    }
  }
  return {};
}

}  // namespace

Result<AdaptiveBrdf> adapt(const Brdf& brdf, const AdaptOptions& options) {
  if (Status status = check(brdf, options); !status) {
    return std::unexpected(status.error());
  }
  const Own own = own_of(brdf);
  const std::vector<double> theta_i = options.theta_i.empty() ? incidences(own) : options.theta_i;
  const std::size_t azimuths = options.azimuths != 0 ? options.azimuths : (own.rotated ? kGridAzimuths : 1);
  const bool isotropic = azimuths == 1;
  const std::size_t side = options.resolution;
  const std::size_t normals_side = options.normals_resolution;
  const auto normals = estimate_normals(brdf, theta_i, normals_side, normals_side / 2 + 1, isotropic);
  if (!normals) {
    return std::unexpected(normals.error());
  }
  AdaptiveBrdf::Content content;
  content.channels = brdf.channels();
  content.wavelengths_nm.assign(brdf.wavelengths_nm().begin(), brdf.wavelengths_nm().end());
  content.metadata = options.metadata;
  if (own.metadata != nullptr) {
    content.metadata.insert(own.metadata->begin(), own.metadata->end());
  }
  content.metadata["adaptive_ndf"] = normals->source;
  for (const double theta : theta_i) {
    content.theta_i.push_back(static_cast<float>(theta));
  }
  for (std::size_t p = 0; p < azimuths; ++p) {
    content.phi_i.push_back(
        isotropic ? 0.0F
                  : static_cast<float>(phi_at(static_cast<double>(p) / static_cast<double>(azimuths - 1))));
  }
  content.ndf = normals->ndf;
  content.sigma = normals->sigma;
  const std::size_t slices = azimuths * theta_i.size();
  std::vector<float> visible(slices * normals_side * normals_side);
  const auto incidence = [&](std::size_t slice) {
    return from_spherical(static_cast<double>(content.theta_i[slice % theta_i.size()]),
                          static_cast<double>(content.phi_i[slice / theta_i.size()]));
  };
  for (std::size_t s = 0; s < slices; ++s) {
    fill_vndf(*normals, incidence(s), normals_side, visible.data() + s * normals_side * normals_side);
  }
  content.vndf = {normals_side, normals_side, std::move(visible)};
  const auto vndf = BilinearWarp::make(content.vndf);
  if (!vndf) {
    return std::unexpected(vndf.error());
  }
  const std::size_t nodes = side * side;
  const std::size_t channels = content.channels;
  content.luminance = {side, side, {}};
  content.spectra = {side, side, {}};
  std::vector<float> luminance(slices * nodes);
  std::vector<float> spectra(slices * nodes * channels);
  content.valid.assign(slices * nodes, 0);
  for (std::size_t s = 0; s < slices; ++s) {
    Slice slice = evaluate(brdf, content, *vndf, s, incidence(s));
    for (std::size_t n = 0; n < nodes; ++n) {
      content.valid[s * nodes + n] = std::isnan(slice.f[n]) ? 0 : 1;
    }
    for (std::size_t c = 0; c < channels; ++c) {
      const std::span<double> f = std::span(slice.f).subspan(c * nodes, nodes);
      if (!extend(f, side)) {
        return fail(ErrorCode::kFailedPrecondition,
                    fmt::format("adaptive form: no direction has a value at theta_i = {:.4g} deg",
                                degrees(theta_i[s % theta_i.size()])),
                    "name the incidences that the data cover");
      }
      for (std::size_t n = 0; n < nodes; ++n) {
        const double stored = slice.factor[n] > 0 ? f[n] * slice.cosine[n] / slice.factor[n] : 0;
        spectra[(s * channels + c) * nodes + n] = static_cast<float>(stored);
        const double weight = channels == 3 ? kLuminance[c] : 1 / static_cast<double>(channels);
        luminance[s * nodes + n] += static_cast<float>(weight * std::max(0.0, stored));
      }
    }
  }
  content.luminance.values = std::move(luminance);
  content.spectra.values = std::move(spectra);
  return AdaptiveBrdf::make(std::move(content));
}

}  // namespace scatter::reflectance
