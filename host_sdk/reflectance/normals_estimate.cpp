#include "host_sdk/reflectance/normals_estimate.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>
#include <string>
#include <vector>

namespace scatter::reflectance {
namespace {

constexpr int kIterations = 24;
/// Share of the retro-reflections up to this angle that must be known to build on them.
constexpr double kLookedAt = radians(60);
constexpr double kKnownShare = 0.9;
/// Every normal keeps this share of an even distribution, so that no direction is out of reach.
constexpr double kEvenShare = 0.02;
/// Azimuths of normals that are averaged for an isotropic material.
constexpr std::size_t kAzimuths = 24;
constexpr std::size_t kSigmaRows = 17;
constexpr std::size_t kSigmaColumns = 33;

/// One row of the table of densities: an azimuth.
using Profile = std::vector<std::optional<double>>;

/// Mean over the channels; nothing where there is no value.
std::optional<double> mean_value(const Brdf& brdf, const Direction& omega_i, const Direction& omega_o,
                                 std::vector<double>& f) {
  const Origin origin = brdf.eval(omega_i, omega_o, f);
  if (origin == Origin::kInvalid || origin == Origin::kExtrapolated) {
    return std::nullopt;
  }
  return std::max(0.0, std::accumulate(f.begin(), f.end(), 0.0) / static_cast<double>(f.size()));
}

double share_of(std::size_t k, std::size_t count) {
  return static_cast<double>(k) / static_cast<double>(count - 1);
}

/// f(omega, omega) along the columns.
Profile retro_profile(const Brdf& brdf, double phi, std::size_t columns, std::vector<double>& f) {
  Profile profile(columns);
  for (std::size_t c = 0; c + 1 < columns; ++c) {
    const Direction omega = from_spherical(theta_at(share_of(c, columns)), phi);
    profile[c] = mean_value(brdf, omega, omega, f);
  }
  return profile;
}

/// 4 f cos_i cos_o for normals at one azimuth seen from all incidences, averaged.
Profile half_profile(const Brdf& brdf, std::span<const double> theta_i, double phi, std::size_t columns,
                     bool isotropic, std::vector<double>& f) {
  Profile profile(columns);
  for (std::size_t c = 0; c < columns; ++c) {
    double sum = 0;
    std::size_t count = 0;
    for (const double theta : theta_i) {
      const Direction omega_i = from_spherical(theta, 0);
      for (std::size_t k = 0; k < (isotropic ? kAzimuths : 1); ++k) {
        const double turn = 2 * kPi * static_cast<double>(k) / static_cast<double>(kAzimuths);
        const Direction m = from_spherical(theta_at(share_of(c, columns)), isotropic ? turn : phi);
        const double twice = 2 * dot(omega_i, m);
        const Direction omega_o{twice * m.x - omega_i.x, twice * m.y - omega_i.y, twice * m.z - omega_i.z};
        if (twice <= 0 || omega_o.z <= 0) {
          continue;
        }
        if (const auto value = mean_value(brdf, omega_i, omega_o, f)) {
          sum += 4 * *value * omega_i.z * omega_o.z;
          ++count;
        }
      }
    }
    if (count > 0) {
      profile[c] = sum / static_cast<double>(count);
    }
  }
  return profile;
}

double known_share(const Profile& profile) {
  std::size_t looked_at = 0;
  std::size_t known = 0;
  for (std::size_t c = 0; c < profile.size() && theta_at(share_of(c, profile.size())) <= kLookedAt; ++c) {
    ++looked_at;
    known += profile[c].has_value();
  }
  return static_cast<double>(known) / static_cast<double>(looked_at);
}

/// Holes filled: linear between known neighbours, constant outside. False when nothing is known.
bool fill(const Profile& profile, float* out) {
  std::optional<std::size_t> last;
  for (std::size_t c = 0; c < profile.size(); ++c) {
    if (!profile[c]) {
      continue;
    }
    for (std::size_t k = last ? *last : 0; k < c; ++k) {
      const double share = last ? static_cast<double>(k - *last) / static_cast<double>(c - *last) : 1;
      out[k] = static_cast<float>((1 - share) * (last ? *profile[*last] : 0) + share * *profile[c]);
    }
    out[c] = static_cast<float>(*profile[c]);
    last = c;
  }
  if (!last) {
    return false;
  }
  std::fill(out + *last, out + profile.size(), out[*last]);
  return true;
}

/// Integral of max(0, cos of the angle between) over the azimuth of one of two directions.
double azimuth_integral(double theta, double theta_m) {
  const double a = std::cos(theta) * std::cos(theta_m);
  const double b = std::sin(theta) * std::sin(theta_m);
  if (a >= b) {
    return 2 * kPi * a;
  }
  const double edge = std::acos(std::clamp(-a / b, -1.0, 1.0));
  return 2 * (a * edge + b * std::sin(edge));
}

/// Linear operator that gives sigma from D: nodes of D weighted by their solid angle.
class ProjectedArea {
 public:
  ProjectedArea(std::size_t columns, std::size_t rows, bool isotropic)
      : isotropic_(isotropic), columns_(columns), rows_(rows) {
    const double step = 1 / static_cast<double>(columns_ - 1);
    for (std::size_t c = 0; c < columns_; ++c) {
      const double x = share_of(c, columns_);
      // dtheta = pi x dx; the trapezium rule's ends count half.
      ring_.push_back(std::sin(theta_at(x)) * kPi * x * step * (c + 1 == columns_ ? 0.5 : 1));
    }
  }

  [[nodiscard]] double at(const std::vector<float>& ndf, double theta, double phi) const {
    double sum = 0;
    if (isotropic_) {
      for (std::size_t c = 0; c < columns_; ++c) {
        sum +=
            static_cast<double>(ndf[c]) * ring_[c] * azimuth_integral(theta, theta_at(share_of(c, columns_)));
      }
      return sum;
    }
    const Direction omega = from_spherical(theta, phi);
    // Rows 0 and last are the same azimuth.
    const double turn = 2 * kPi / static_cast<double>(rows_ - 1);
    for (std::size_t r = 0; r + 1 < rows_; ++r) {
      const double phi_m = phi_at(share_of(r, rows_));
      const double along = omega.x * std::cos(phi_m) + omega.y * std::sin(phi_m);
      for (std::size_t c = 0; c < columns_; ++c) {
        const double theta_m = theta_at(share_of(c, columns_));
        const double cosine = std::max(0.0, along * std::sin(theta_m) + omega.z * std::cos(theta_m));
        sum += static_cast<double>(ndf[r * columns_ + c]) * ring_[c] * turn * cosine;
      }
    }
    return sum;
  }

 private:
  bool isotropic_;
  std::size_t columns_;
  std::size_t rows_;
  std::vector<double> ring_;
};

/// Why there is nothing to build on: incidences without a value, or values that are all 0.
std::unexpected<Error> nothing_to_build_on(const Brdf& brdf, std::span<const double> theta_i,
                                           std::vector<double>& f) {
  constexpr std::size_t kRows = 30;
  constexpr std::size_t kColumns = 72;
  std::string without;
  std::string all_zero;
  bool mirror = false;
  for (const double theta : theta_i) {
    const Direction omega_i = from_spherical(theta, 0);
    bool known = false;
    for (std::size_t k = 0; k < kRows * kColumns && !known; ++k) {
      const double theta_o = share_of(k / kColumns, kRows) * radians(88);
      const double phi_o = phi_at(share_of(k % kColumns, kColumns));
      known = mean_value(brdf, omega_i, from_spherical(theta_o, phi_o), f).has_value();
    }
    std::string& list = known ? all_zero : without;
    list += fmt::format("{}{:.4g}", list.empty() ? "" : ", ", degrees(theta));
    mirror = mirror || brdf.dirac(omega_i, f);
  }
  if (mirror) {
    return fail(ErrorCode::kFailedPrecondition,
                "adaptive form: all light leaves in the mirror direction alone, which its tables cannot hold",
                "give the model some roughness, or name the model itself where it is used");
  }
  if (!without.empty()) {
    return fail(
        ErrorCode::kFailedPrecondition,
        fmt::format("adaptive form: too few values to make a material of: none at theta_i = {} deg", without),
        "name the incidences that the data cover (--incidences), or convert to BiRD, which keeps single "
        "directions");
  }
  return fail(ErrorCode::kFailedPrecondition,
              fmt::format("adaptive form: every value is 0 at theta_i = {} deg", all_zero),
              "check the data with 'scatter inspect'");
}

}  // namespace

Result<NormalsEstimate> estimate_normals(const Brdf& brdf, std::span<const double> theta_i,
                                         std::size_t columns, std::size_t rows, bool isotropic) {
  NormalsEstimate out;
  std::vector<float> ndf(columns * (isotropic ? 2 : rows));
  const std::size_t profiles = isotropic ? 1 : rows;
  std::vector<double> f(brdf.channels());
  std::vector<Profile> retro;
  double known = 1;
  for (std::size_t r = 0; r < profiles; ++r) {
    retro.push_back(retro_profile(brdf, isotropic ? 0 : phi_at(share_of(r, rows)), columns, f));
    known = std::min(known, known_share(retro.back()));
  }
  const bool by_retro = known >= kKnownShare;
  out.source = by_retro ? "retro-reflection" : "half vectors";
  bool any = false;
  for (std::size_t r = 0; r < profiles; ++r) {
    const Profile profile = by_retro
                                ? retro[r]
                                : half_profile(brdf, theta_i, phi_at(share_of(r, profiles == 1 ? 2 : rows)),
                                               columns, isotropic, f);
    any = fill(profile, ndf.data() + r * columns) || any;
  }
  if (!any || !std::ranges::any_of(ndf, [](float v) { return v > 0; })) {
    return nothing_to_build_on(brdf, theta_i, f);
  }
  const ProjectedArea area(columns, isotropic ? 1 : rows, isotropic);
  const std::vector<float> weight = ndf;
  const std::size_t sigma_columns = isotropic ? columns : kSigmaColumns;
  const std::size_t sigma_rows = isotropic ? 2 : kSigmaRows;
  std::vector<float> sigma(sigma_columns * sigma_rows, 1.0F);
  const auto update_sigma = [&] {
    const double scale = 1 / area.at(ndf, 0, 0);
    for (float& d : ndf) {
      d = static_cast<float>(static_cast<double>(d) * scale);
    }
    for (std::size_t r = 0; r < (isotropic ? 1 : sigma_rows); ++r) {
      for (std::size_t c = 0; c < sigma_columns; ++c) {
        sigma[r * sigma_columns + c] = static_cast<float>(area.at(
            ndf, theta_at(share_of(c, sigma_columns)), isotropic ? 0 : phi_at(share_of(r, sigma_rows))));
      }
    }
  };
  update_sigma();
  // D = constant f(omega, omega) cos(theta) sigma(omega): the eigenvector of a linear operator.
  for (int k = 0; k < (by_retro ? kIterations : 0); ++k) {
    for (std::size_t r = 0; r < profiles; ++r) {
      for (std::size_t c = 0; c < columns; ++c) {
        const double x = share_of(c, columns);
        const double area_here =
            bilinear(sigma.data(), sigma_columns,
                     cell_at(sigma_columns, sigma_rows, {x, isotropic ? 0 : share_of(r, rows)}));
        ndf[r * columns + c] = static_cast<float>(static_cast<double>(weight[r * columns + c]) *
                                                  std::cos(theta_at(x)) * area_here);
      }
    }
    update_sigma();
  }
  for (float& d : ndf) {
    d += static_cast<float>(kEvenShare / kPi);
  }
  update_sigma();
  if (isotropic) {
    std::copy_n(ndf.begin(), columns, ndf.begin() + static_cast<std::ptrdiff_t>(columns));
    std::copy_n(sigma.begin(), columns, sigma.begin() + static_cast<std::ptrdiff_t>(columns));
  }
  out.ndf = {columns, isotropic ? 2 : rows, std::move(ndf)};
  out.sigma = {sigma_columns, sigma_rows, std::move(sigma)};
  return out;
}

}  // namespace scatter::reflectance
