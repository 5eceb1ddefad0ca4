#include "host_sdk/formats/dirac_share.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

namespace scatter::formats {
namespace {

using reflectance::Brdf;
using reflectance::Direction;
using reflectance::radians;

/// Angles from the mirror (or straight) direction that find a lobe of any width [deg].
constexpr std::array kRadials_deg{0.0, 0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 20.0, 30.0, 45.0, 60.0, 80.0};
constexpr int kAzimuths = 12;

bool has_values(const Brdf& brdf, double theta_i) {
  const double side = brdf.type() == reflectance::ScatterType::kBtdf ? -1 : 1;
  std::vector<Direction> omega_o;
  for (const double radial : kRadials_deg) {
    for (int k = 0; k < kAzimuths; ++k) {
      const Direction d = reflectance::from_spherical(radians(radial), 2 * reflectance::kPi * k / kAzimuths);
      const double x = d.x * std::cos(theta_i) - d.z * std::sin(theta_i);
      const double z = d.x * std::sin(theta_i) + d.z * std::cos(theta_i);
      if (z > 0) {
        omega_o.push_back({x, d.y, side * z});
      }
    }
  }
  std::vector<double> f(omega_o.size() * brdf.channels());
  brdf.eval_batch(reflectance::from_spherical(theta_i, 0), omega_o, f, {});
  return std::ranges::any_of(f, [](double value) { return value != 0; });
}

}  // namespace

std::optional<DiracShare> dirac_share(const Brdf& brdf, std::span<const Direction> omega_i) {
  std::optional<DiracShare> share;
  std::vector<double> weight(brdf.channels());
  for (const Direction& light : omega_i) {
    if (!brdf.dirac(light, weight)) {
      continue;
    }
    const double most = *std::ranges::max_element(weight);
    if (most > 0) {
      share = share ? DiracShare{std::min(share->least, most), std::max(share->most, most)}
                    : DiracShare{most, most};
    }
  }
  return share;
}

Status check_not_dirac_alone(const Brdf& brdf, std::string_view format) {
  constexpr std::array kTheta_deg{0.0, 20.0, 40.0, 60.0};
  std::vector<Direction> omega_i;
  for (const double theta : kTheta_deg) {
    omega_i.push_back(reflectance::from_spherical(radians(theta), 0));
  }
  const auto share = dirac_share(brdf, omega_i);
  if (!share || std::ranges::any_of(kTheta_deg, [&](double t) { return has_values(brdf, radians(t)); })) {
    return {};
  }
  return fail(ErrorCode::kFailedPrecondition,
              fmt::format("all light leaves in exactly one direction (Dirac share, albedo {:.4f}), expected "
                          "values in 1/sr: the format {} would hold nothing but zeros",
                          share->most, format),
              "choose a narrow lobe instead, for example ggx:alpha=0.01");
}

}  // namespace scatter::formats
