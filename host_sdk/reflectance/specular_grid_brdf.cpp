#include "host_sdk/reflectance/specular_grid_brdf.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "host_sdk/reflectance/lookup_chunks.h"

namespace scatter::reflectance {
namespace {

/// Rounding of angles given in degrees; nearer than this to a node is the node [rad].
constexpr double kSameAngle = 1e-8;
/// Two incidences closer than this are the same one [rad]; as in GridBrdf.
constexpr double kSameIncidence = 1e-6;
/// Rotations farther apart than this are not interpolated [rad].
constexpr double kWidestRotationGap = kPi / 2 + kSameAngle;
/// Largest step of the integration [rad]; cells of the grid are cut until they are finer.
constexpr double kIntegrationStep = kPi / 180 * 1.0001;

std::unexpected<Error> bad(std::string what, std::string remedy = "give one finite value per node") {
  return fail(ErrorCode::kInvalidArgument, "specular grid: " + std::move(what), std::move(remedy));
}

Status check_axis(const std::vector<double>& axis, std::string_view name, double lowest, double highest) {
  if (axis.empty()) {
    return bad(fmt::format("no {}", name), "list every axis");
  }
  for (std::size_t k = 0; k < axis.size(); ++k) {
    if (!(axis[k] >= lowest - kSameAngle && axis[k] <= highest + kSameAngle)) {
      return bad(fmt::format("{} {} of {} is {:.10g} deg, expected {:g}..{:g}", name, k + 1, axis.size(),
                             degrees(axis[k]), degrees(lowest), degrees(highest)),
                 fmt::format("keep every {} within {:g}..{:g} deg", name, degrees(lowest), degrees(highest)));
    }
    if (k > 0 && !(axis[k] > axis[k - 1])) {
      return bad(fmt::format("{} {} of {} is {:.10g} deg after {:.10g} deg, expected ascending angles", name,
                             k + 1, axis.size(), degrees(axis[k]), degrees(axis[k - 1])),
                 "list every axis in ascending order");
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
  build_lookup();
}

void SpecularGridBrdf::build_lookup() {
  const std::size_t azimuths = content_.azimuth.size();
  const std::size_t radials = content_.radial.size();
  std::vector<double> rows = content_.azimuth;
  // Azimuths go on from the last to the first, which then stands after the last as well.
  const double first_again = rows.front() + 2 * kPi;
  if (!content_.plane_symmetric && first_again - rows.back() > kSameAngle) {
    rows.push_back(first_again);
  }
  const std::size_t blocks = content_.rotation.size() * content_.theta_i.size();
  CellTable table(content_.f_per_sr.size(), blocks, rows.size() + 1, radials + 1);
  for (std::size_t b = 0; b < blocks; ++b) {
    for (std::size_t j = 0; j <= rows.size(); ++j) {
      const std::size_t azimuth = std::min(j, rows.size() - 1) % azimuths;
      for (std::size_t i = 0; i <= radials; ++i) {
        const std::size_t radial = std::min(i, radials - 1);
        const std::size_t node = (b * azimuths + azimuth) * radials + radial;
        const Origin origin = origin_of(b % content_.theta_i.size(), azimuth, radial, node);
        const std::size_t at = table.index(b, j, i);
        table.set_origin(at, origin);
        for (std::size_t c = 0; c < content_.f_per_sr.size() && origin != Origin::kInvalid; ++c) {
          table.set(at, c, content_.f_per_sr[c][node]);
        }
      }
    }
  }
  table.close_cells();
  lookup_.table = std::move(table);
  lookup_.transmits = content_.type == ScatterType::kBtdf;
  lookup_.folded = content_.plane_symmetric;
  lookup_.periodic = !content_.plane_symmetric;
  lookup_.azimuth.set(std::move(rows));
  lookup_.azimuth.open_low = content_.plane_symmetric && content_.azimuth.front() > kSameAngle;
  lookup_.azimuth.open_high = content_.plane_symmetric && content_.azimuth.back() < kPi - kSameAngle;
  lookup_.radial.set(content_.radial);
  lookup_.radial.open_low = content_.radial.front() > kSameAngle;
  lookup_.radial.open_high = content_.radial.back() < kPi - kSameAngle;
  lookup_.same_angle = kSameAngle;
  const auto together = [](double a, double b) { return b - a <= 2 * kSameIncidence; };
  if (content_.rotation.size() == 1 &&
      std::ranges::adjacent_find(content_.theta_i, together) == content_.theta_i.end()) {
    lookup_.incidences.set(content_.theta_i, std::vector<double>(content_.theta_i.size(), 0.0));
    lookup_.incidences.same_angle = kSameIncidence;
  }
}

Origin SpecularGridBrdf::origin_of(std::size_t incidence, std::size_t azimuth, std::size_t radial,
                                   std::size_t node) const noexcept {
  if (!content_.origin.empty()) {
    return content_.origin[node];
  }
  return above_horizon(incidence, azimuth, radial) ? Origin::kMeasured : Origin::kExtrapolated;
}

SpecularGridBrdf::Bracket SpecularGridBrdf::bracket(std::span<const double> axis, double value,
                                                    double same) noexcept {
  const auto above = static_cast<std::size_t>(std::ranges::lower_bound(axis, value - same) - axis.begin());
  if (above == axis.size()) {
    return {above - 1, above - 1, 0, true};
  }
  if (axis[above] <= value + same) {
    return {above, above, 0, false};
  }
  if (above == 0) {
    return {0, 0, 0, true};
  }
  return {above - 1, above, (value - axis[above - 1]) / (axis[above] - axis[above - 1]), false};
}

SpecularGridBrdf::Bracket SpecularGridBrdf::periodic(std::span<const double> axis, double value,
                                                     double widest) noexcept {
  Bracket found = bracket(axis, value, kSameAngle);
  double gap = 0;
  if (found.outside) {
    const double first = axis.front();
    const double last = axis.back();
    gap = first + 2 * kPi - last;
    const double from_last = value >= last ? value - last : value + 2 * kPi - last;
    if (gap <= kSameAngle) {
      found = {axis.size() - 1, axis.size() - 1, 0, false};
    } else if (gap - from_last <= kSameAngle) {
      found = {0, 0, 0, false};
    } else {
      found = {axis.size() - 1, 0, std::clamp(from_last / gap, 0.0, 1.0), false};
    }
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
  Origin origin = kAskScalar;
  if (lookup_.incidences.count != 0) {
    origin = look_up_one(lookup_, omega_i, omega_o, f_per_sr);
  }
  if (origin == kAskScalar) {
    origin = blend(content_.f_per_sr, omega_i, omega_o, f_per_sr);
    if (origin == Origin::kInvalid) {
      std::ranges::fill(f_per_sr, 0.0);
    }
  }
  return origin;
}

IncidenceShares SpecularGridBrdf::shares_of(const Direction& omega_i) const noexcept {
  IncidenceShares out;
  if (!(omega_i.z > 0)) {
    out.origin = Origin::kInvalid;
    return out;
  }
  const double sin_a = std::hypot(omega_i.x, omega_i.y);
  // At normal incidence the light has no azimuth; the limit from phi_i = 0 is taken.
  const bool normal = sin_a < kSameIncidence;
  out.cos_phi = normal ? 1.0 : omega_i.x / sin_a;
  out.sin_phi = normal ? 0.0 : omega_i.y / sin_a;
  const Bracket incidence = bracket(content_.theta_i, std::atan2(sin_a, omega_i.z), kSameIncidence);
  const Bracket rotation =
      content_.rotation.size() == 1
          ? Bracket{}
          : periodic(content_.rotation, normal ? 0.0 : phi_of(omega_i), kWidestRotationGap);
  if (incidence.share > 0 || rotation.share > 0) {
    out.origin = Origin::kInterpolated;
  }
  if (incidence.outside || rotation.outside) {
    out.origin = Origin::kExtrapolated;
  }
  for (int corner = 0; corner < 4; ++corner) {
    const bool later = (corner & 2) != 0;
    const bool steeper = (corner & 1) != 0;
    const double weight =
        (later ? rotation.share : 1 - rotation.share) * (steeper ? incidence.share : 1 - incidence.share);
    if (weight > 0) {
      const std::size_t block = (later ? rotation.above : rotation.below) * content_.theta_i.size() +
                                (steeper ? incidence.above : incidence.below);
      out.blocks[out.count++] = {static_cast<std::uint32_t>(block), omega_i.z, -sin_a, 0, weight};
    }
  }
  return out;
}

void SpecularGridBrdf::eval_batch(const Direction& omega_i, std::span<const Direction> omega_o,
                                  std::span<double> f_per_sr, std::span<Origin> origin) const noexcept {
  const IncidenceShares shares = shares_of(omega_i);
  if (shares.origin == Origin::kInvalid) {
    std::ranges::fill(f_per_sr, 0.0);
    std::ranges::fill(origin, Origin::kInvalid);
    return;
  }
  in_chunks(
      omega_o.size(), channels(), f_per_sr, origin,
      [&](std::size_t first, std::span<double> f, std::span<Origin> from) {
        look_up(lookup_, shares, omega_o.subspan(first, from.size()), f, from);
      },
      [&](std::size_t k, std::span<double> f) {
        const Origin found = blend(content_.f_per_sr, omega_i, omega_o[k], f);
        if (found == Origin::kInvalid) {
          std::ranges::fill(f, 0.0);
        }
        return found;
      });
}

void SpecularGridBrdf::eval_pairs(std::span<const Direction> omega_i, std::span<const Direction> omega_o,
                                  std::span<double> f_per_sr, std::span<Origin> origin) const noexcept {
  if (lookup_.incidences.count == 0) {
    Brdf::eval_pairs(omega_i, omega_o, f_per_sr, origin);
    return;
  }
  in_chunks(
      omega_o.size(), channels(), f_per_sr, origin,
      [&](std::size_t first, std::span<double> f, std::span<Origin> from) {
        look_up_pairs(lookup_, omega_i.subspan(first, from.size()), omega_o.subspan(first, from.size()), f,
                      from);
      },
      [&](std::size_t k, std::span<double> f) {
        const Origin found = blend(content_.f_per_sr, omega_i[k], omega_o[k], f);
        if (found == Origin::kInvalid) {
          std::ranges::fill(f, 0.0);
        }
        return found;
      });
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
  const double phi_i = sin_a < kSameIncidence ? 0.0 : phi_of(omega_i);
  const double c = sin_a < kSameIncidence ? 1.0 : omega_i.x / sin_a;
  const double s = sin_a < kSameIncidence ? 0.0 : omega_i.y / sin_a;
  const Direction local{omega_o.x * c + omega_o.y * s, omega_o.y * c - omega_o.x * s, up};
  const Direction offset{local.x * cos_a + local.z * sin_a, local.y, local.z * cos_a - local.x * sin_a};
  double psi = phi_of(offset);
  if (content_.plane_symmetric && psi > kPi) {
    psi = 2 * kPi - psi;
  }
  const Bracket radial = bracket(content_.radial, theta_of(offset), kSameAngle);
  const Bracket azimuth = content_.plane_symmetric ? bracket(content_.azimuth, psi, kSameAngle)
                                                   : periodic(content_.azimuth, psi, 2 * kPi + kSameAngle);
  const Bracket incidence = bracket(content_.theta_i, std::atan2(sin_a, cos_a), kSameIncidence);
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
    origin = combined(origin, origin_of(a, p, r, node));
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

std::vector<Direction> SpecularGridBrdf::own_incidences() const {
  std::vector<Direction> out;
  for (const double rotation : content_.rotation) {
    for (const double theta_i : content_.theta_i) {
      out.push_back(from_spherical(theta_i, rotation));
    }
  }
  return out;
}

}  // namespace scatter::reflectance
