#include "host_sdk/reflectance/specular_grid_brdf.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

namespace scatter::reflectance {
namespace {

/// Rounding of angles given in degrees; nearer than this to a node is the node [rad].
constexpr double kSameAngle = 1e-8;
/// Rotations farther apart than this are not interpolated [rad].
constexpr double kWidestRotationGap = kPi / 2 + kSameAngle;
/// Largest step of the integration [rad]; cells of the grid are cut until they are finer.
constexpr double kIntegrationStep = kPi / 180 * 1.0001;

std::unexpected<Error> bad(std::string what) {
  return fail(ErrorCode::kInvalidArgument, "specular grid: " + std::move(what),
              "list every axis in ascending order and one value per node");
}

Status check_axis(const std::vector<double>& axis, std::string_view name, double lowest, double highest) {
  if (axis.empty()) {
    return bad(fmt::format("no {}", name));
  }
  for (std::size_t k = 0; k < axis.size(); ++k) {
    if (!(axis[k] >= lowest - kSameAngle && axis[k] <= highest + kSameAngle)) {
      return bad(fmt::format("{} {} is {} deg, expected {}..{}", name, k, degrees(axis[k]), degrees(lowest),
                             degrees(highest)));
    }
    if (k > 0 && !(axis[k] > axis[k - 1])) {
      return bad(fmt::format("{} {} is {} deg after {} deg, expected ascending angles", name, k,
                             degrees(axis[k]), degrees(axis[k - 1])));
    }
  }
  return {};
}

}  // namespace

Result<SpecularGridBrdf> SpecularGridBrdf::make(Content content) {
  for (const Status& status :
       {check_axis(content.rotation, "sample rotation", 0, 2 * kPi),
        check_axis(content.theta_i, "angle of incidence", 0, radians(89.9999)),
        check_axis(content.azimuth, "scatter azimuth", 0, content.plane_symmetric ? kPi : 2 * kPi),
        check_axis(content.radial, "scatter radial", 0, kPi)}) {
    if (!status) {
      return std::unexpected(status.error());
    }
  }
  const std::size_t blocks = content.rotation.size() * content.theta_i.size();
  const std::size_t expected = blocks * content.azimuth.size() * content.radial.size();
  if (content.f_per_sr.empty()) {
    return bad("no channel");
  }
  for (const auto* planes : {&content.f_per_sr, &content.sigma_per_sr}) {
    for (const auto& plane : *planes) {
      if (plane.size() != expected) {
        return bad(fmt::format("{} values, expected {}", plane.size(), expected));
      }
      if (!std::ranges::all_of(plane, [](float f) { return std::isfinite(f); })) {
        return bad("a value that is not a finite number");
      }
    }
  }
  if (!content.sigma_per_sr.empty() && content.sigma_per_sr.size() != content.f_per_sr.size()) {
    return bad(fmt::format("{} uncertainty channels for {} channels", content.sigma_per_sr.size(),
                           content.f_per_sr.size()));
  }
  if (!content.origin.empty() && content.origin.size() != expected) {
    return bad(fmt::format("{} origins, expected {}", content.origin.size(), expected));
  }
  if (!content.wavelengths_nm.empty() && content.wavelengths_nm.size() != content.f_per_sr.size()) {
    return bad(fmt::format("{} wavelengths for {} channels", content.wavelengths_nm.size(),
                           content.f_per_sr.size()));
  }
  if (!content.stated_total.empty() &&
      (content.stated_total.size() != content.f_per_sr.size() ||
       std::ranges::any_of(content.stated_total, [&](const auto& t) { return t.size() != blocks; }))) {
    return bad(fmt::format("stated totals, expected {} per channel", blocks));
  }
  return SpecularGridBrdf(std::move(content));
}

SpecularGridBrdf::SpecularGridBrdf(Content content) : content_(std::move(content)) {
  for (const double psi : content_.azimuth) {
    cos_azimuth_.push_back(std::cos(psi));
  }
  for (const double rho : content_.radial) {
    cos_radial_.push_back(std::cos(rho));
    sin_radial_.push_back(std::sin(rho));
  }
  for (const double a : content_.theta_i) {
    cos_i_.push_back(std::cos(a));
    sin_i_.push_back(std::sin(a));
  }
}

SpecularGridBrdf::Bracket SpecularGridBrdf::bracket(std::span<const double> axis, double value) noexcept {
  const auto above =
      static_cast<std::size_t>(std::ranges::lower_bound(axis, value - kSameAngle) - axis.begin());
  if (above == axis.size()) {
    return {above - 1, above - 1, 0, true};
  }
  if (axis[above] <= value + kSameAngle) {
    return {above, above, 0, false};
  }
  if (above == 0) {
    return {0, 0, 0, true};
  }
  return {above - 1, above, (value - axis[above - 1]) / (axis[above] - axis[above - 1]), false};
}

SpecularGridBrdf::Bracket SpecularGridBrdf::periodic(std::span<const double> axis, double value,
                                                     double widest) noexcept {
  Bracket found = bracket(axis, value);
  double gap = 0;
  if (found.outside) {
    const double first = axis.front();
    const double last = axis.back();
    gap = first + 2 * kPi - last;
    const double from_last = value >= last ? value - last : value + 2 * kPi - last;
    found = gap <= kSameAngle ? Bracket{axis.size() - 1, axis.size() - 1, 0, false}
                              : Bracket{axis.size() - 1, 0, std::clamp(from_last / gap, 0.0, 1.0), false};
  } else {
    gap = axis[found.above] - axis[found.below];
  }
  if (gap > widest) {
    const std::size_t nearest = found.share < 0.5 ? found.below : found.above;
    return {nearest, nearest, 0, true};
  }
  return found;
}

bool SpecularGridBrdf::above_horizon(std::size_t incidence, std::size_t azimuth,
                                     std::size_t radial) const noexcept {
  return cos_radial_[radial] * cos_i_[incidence] +
             sin_radial_[radial] * cos_azimuth_[azimuth] * sin_i_[incidence] >
         -kSameAngle;
}

Origin SpecularGridBrdf::eval(const Direction& omega_i, const Direction& omega_o,
                              std::span<double> f_per_sr) const noexcept {
  const Origin origin = blend(content_.f_per_sr, omega_i, omega_o, f_per_sr);
  if (origin == Origin::kInvalid) {
    std::ranges::fill(f_per_sr, 0.0);
  }
  return origin;
}

bool SpecularGridBrdf::uncertainty(const Direction& omega_i, const Direction& omega_o,
                                   std::span<double> random_per_sr,
                                   std::span<double> systematic_per_sr) const noexcept {
  if (content_.sigma_per_sr.empty() ||
      blend(content_.sigma_per_sr, omega_i, omega_o, systematic_per_sr) == Origin::kInvalid) {
    return false;
  }
  std::ranges::fill(random_per_sr, 0.0);
  return true;
}

Origin SpecularGridBrdf::blend(const std::vector<std::vector<float>>& planes, const Direction& omega_i,
                               const Direction& omega_o, std::span<double> out) const noexcept {
  const double up = content_.type == ScatterType::kBrdf ? omega_o.z : -omega_o.z;
  if (!(omega_i.z > 0 && up > 0)) {
    return Origin::kInvalid;
  }
  const double sin_a = std::hypot(omega_i.x, omega_i.y);
  const double cos_a = omega_i.z;
  // At normal incidence the light has no azimuth; the limit from phi_i = 0 is taken.
  const double phi_i = sin_a < kSameAngle ? 0.0 : phi_of(omega_i);
  const double c = sin_a < kSameAngle ? 1.0 : omega_i.x / sin_a;
  const double s = sin_a < kSameAngle ? 0.0 : omega_i.y / sin_a;
  const Direction local{omega_o.x * c + omega_o.y * s, omega_o.y * c - omega_o.x * s, up};
  const Direction offset{local.x * cos_a + local.z * sin_a, local.y, local.z * cos_a - local.x * sin_a};
  double psi = phi_of(offset);
  if (content_.plane_symmetric && psi > kPi) {
    psi = 2 * kPi - psi;
  }
  const Bracket radial = bracket(content_.radial, theta_of(offset));
  const Bracket azimuth = content_.plane_symmetric ? bracket(content_.azimuth, psi)
                                                   : periodic(content_.azimuth, psi, 2 * kPi + kSameAngle);
  const Bracket incidence = bracket(content_.theta_i, std::atan2(sin_a, cos_a));
  const Bracket rotation =
      content_.rotation.size() == 1 ? Bracket{} : periodic(content_.rotation, phi_i, kWidestRotationGap);

  Origin origin = Origin::kMeasured;
  if (incidence.share > 0 || rotation.share > 0) {
    origin = Origin::kInterpolated;
  }
  if (incidence.outside || rotation.outside || radial.outside || azimuth.outside) {
    origin = Origin::kExtrapolated;
  }
  std::array<std::pair<std::size_t, double>, 16> taps;
  std::size_t count = 0;
  for (int corner = 0; corner < 16; ++corner) {
    const auto pick = [&](const Bracket& b, int bit) {
      const bool high = ((corner >> bit) & 1) != 0;
      return std::pair(high ? b.above : b.below, high ? b.share : 1 - b.share);
    };
    const auto [r, weight_r] = pick(radial, 0);
    const auto [p, weight_p] = pick(azimuth, 1);
    const auto [a, weight_a] = pick(incidence, 2);
    const auto [q, weight_q] = pick(rotation, 3);
    const double weight = weight_r * weight_p * weight_a * weight_q;
    if (weight == 0) {
      continue;
    }
    const std::size_t node =
        ((q * content_.theta_i.size() + a) * content_.azimuth.size() + p) * content_.radial.size() + r;
    if (!content_.origin.empty()) {
      origin = combined(origin, content_.origin[node]);
    } else if (!above_horizon(a, p, r)) {
      origin = combined(origin, Origin::kExtrapolated);
    }
    taps[count++] = {node, weight};
  }
  if (origin == Origin::kInvalid) {
    return origin;
  }
  std::ranges::fill(out, 0.0);
  for (const auto& [node, weight] : std::span(taps).first(count)) {
    for (std::size_t channel = 0; channel < out.size(); ++channel) {
      out[channel] += weight * static_cast<double>(planes[channel][node]);
    }
  }
  return origin;
}

double SpecularGridBrdf::integral(std::size_t channel, std::size_t rotation, std::size_t incidence,
                                  bool hold_last, bool weigh_by_cosine) const {
  /// Midpoint of a piece of a cell, with the share of the cell's upper node.
  struct Piece {
    std::size_t below, above;
    double share, at, width;
  };
  const auto cut = [](std::vector<Piece>& out, std::size_t below, std::size_t above, double from, double to) {
    const auto count = static_cast<std::size_t>(std::ceil((to - from) / kIntegrationStep));
    const double width = (to - from) / static_cast<double>(count);
    for (std::size_t k = 0; k < count; ++k) {
      const double share = (static_cast<double>(k) + 0.5) / static_cast<double>(count);
      out.push_back({below, above, share, from + share * (to - from), width});
    }
  };
  std::vector<Piece> radials;
  for (std::size_t k = 0; k + 1 < content_.radial.size(); ++k) {
    cut(radials, k, k + 1, content_.radial[k], content_.radial[k + 1]);
  }
  if (hold_last && content_.radial.back() < kPi) {
    cut(radials, content_.radial.size() - 1, content_.radial.size() - 1, content_.radial.back(), kPi);
  }
  std::vector<Piece> azimuths;
  const std::vector<double>& psi = content_.azimuth;
  for (std::size_t k = 0; k + 1 < psi.size(); ++k) {
    cut(azimuths, k, k + 1, psi[k], psi[k + 1]);
  }
  if (!content_.plane_symmetric && psi.front() + 2 * kPi - psi.back() > kSameAngle) {
    cut(azimuths, psi.size() - 1, 0, psi.back(), psi.front() + 2 * kPi);
  }
  const float* values = content_.f_per_sr[channel].data() + (rotation * content_.theta_i.size() + incidence) *
                                                                psi.size() * content_.radial.size();
  std::vector<double> cosine_psi;
  for (const Piece& p : azimuths) {
    cosine_psi.push_back(std::cos(p.at));
  }
  double total = 0;
  for (const Piece& r : radials) {
    const double sine = std::sin(r.at);
    const double along = std::cos(r.at) * cos_i_[incidence];
    const double across = sine * sin_i_[incidence];
    for (std::size_t k = 0; k < azimuths.size(); ++k) {
      const Piece& p = azimuths[k];
      const double cosine = along + across * cosine_psi[k];
      if (cosine <= 0) {
        continue;
      }
      const float* low = values + p.below * content_.radial.size();
      const float* high = values + p.above * content_.radial.size();
      const double f = (1 - p.share) * ((1 - r.share) * low[r.below] + r.share * low[r.above]) +
                       p.share * ((1 - r.share) * high[r.below] + r.share * high[r.above]);
      total += f * (weigh_by_cosine ? cosine : 1.0) * sine * r.width * p.width;
    }
  }
  return content_.plane_symmetric ? 2 * total : total;
}

}  // namespace scatter::reflectance
