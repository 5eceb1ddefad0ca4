#include "host_sdk/reflectance/half_difference_brdf.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <utility>

namespace scatter::reflectance {
namespace {

/// Neighbouring cells on an axis, and the share of the upper one.
struct Neighbours {
  std::size_t below = 0;
  std::size_t above = 0;
  double share = 0;
  std::size_t nearest = 0;
};

/// place: 0..count, cell k covers k..k+1.
Neighbours neighbours(double place, std::size_t count, bool periodic) noexcept {
  const auto n = static_cast<double>(count);
  const std::size_t nearest = std::min(static_cast<std::size_t>(std::clamp(place, 0.0, n)), count - 1);
  const double centred = periodic ? place - 0.5 : std::clamp(place - 0.5, 0.0, n - 1);
  const double floor = std::floor(centred);
  const auto below = static_cast<std::size_t>(floor < 0 ? floor + n : floor) % count;
  const std::size_t above = periodic ? (below + 1) % count : std::min(below + 1, count - 1);
  return {below, above, centred - floor, nearest};
}

}  // namespace

HalfDifference HalfDifference::of(const Direction& omega_i, const Direction& omega_o) noexcept {
  const Direction h = normalized({omega_i.x + omega_o.x, omega_i.y + omega_o.y, omega_i.z + omega_o.z});
  const double sine = std::hypot(h.x, h.y);
  // Frame of the half vector: x in the plane of h and the normal, pointing down; y level.
  const Direction level = sine > 0 ? Direction{-h.y / sine, h.x / sine, 0} : Direction{0, 1, 0};
  const Direction down = cross(level, h);
  const double x = dot(omega_i, down);
  const double y = dot(omega_i, level);
  const double z = dot(omega_i, h);
  double phi = std::atan2(y, x);
  phi = phi < 0 ? phi + 2 * kPi : phi;
  return {std::atan2(sine, h.z), std::atan2(std::hypot(x, y), z), phi};
}

DirectionPair directions_of(const HalfDifference& place) noexcept {
  const Direction d = from_spherical(place.theta_d, place.phi_d);
  const double s = std::sin(place.theta_h);
  const double c = std::cos(place.theta_h);
  return {{c * d.x + s * d.z, d.y, c * d.z - s * d.x}, {s * d.z - c * d.x, -d.y, c * d.z + s * d.x}};
}

HalfDifference HalfDifferenceBrdf::Content::centre(std::size_t theta_h, std::size_t theta_d,
                                                   std::size_t phi_d) const noexcept {
  const auto share = [](std::size_t k, std::size_t n) {
    return (static_cast<double>(k) + 0.5) / static_cast<double>(n);
  };
  const double h = share(theta_h, theta_h_count);
  return {h * h * kPi / 2, share(theta_d, theta_d_count) * kPi / 2, share(phi_d, phi_d_count) * phi_range()};
}

Result<HalfDifferenceBrdf> HalfDifferenceBrdf::make(Content content, Lookup lookup) {
  const auto bad = [](const std::string& what) {
    return fail(ErrorCode::kInvalidArgument, what, "export the table again");
  };
  constexpr std::size_t kMost = 10'000;
  for (const std::size_t count :
       {content.theta_h_count, content.theta_d_count, content.phi_d_count, content.channels}) {
    if (count < 1 || count > kMost) {
      return bad(fmt::format(
          "half/difference table of {} x {} x {} cells and {} channels, expected 1..{} each",
          content.theta_h_count, content.theta_d_count, content.phi_d_count, content.channels, kMost));
    }
  }
  if (content.f_per_sr.size() != content.cells() * content.channels ||
      (!content.wavelengths_nm.empty() && content.wavelengths_nm.size() != content.channels)) {
    return bad(fmt::format("half/difference table: {} values and {} wavelengths, expected {} in {} channels",
                           content.f_per_sr.size(), content.wavelengths_nm.size(),
                           content.cells() * content.channels, content.channels));
  }
  std::uint32_t worst = 0;
  for (const float f : content.f_per_sr) {
    worst = std::max(worst, std::bit_cast<std::uint32_t>(f) & 0x7FFFFFFFU);
  }
  if (worst >= 0x7F800000U) {
    const auto at = std::ranges::find_if(content.f_per_sr, [](float f) { return !std::isfinite(f); });
    return bad(fmt::format("half/difference table: value {} is {}, expected a finite number",
                           at - content.f_per_sr.begin(), *at));
  }
  return HalfDifferenceBrdf(std::move(content), lookup);
}

bool HalfDifferenceBrdf::has_value(std::size_t cell) const noexcept {
  for (std::size_t c = 0; c < content_.channels; ++c) {
    if (content_.f_per_sr[c * content_.cells() + cell] < 0) {
      return false;
    }
  }
  return true;
}

Origin HalfDifferenceBrdf::eval(const Direction& omega_i, const Direction& omega_o,
                                std::span<double> f_per_sr) const noexcept {
  std::ranges::fill(f_per_sr, 0.0);
  if (!(omega_i.z > 0 && omega_o.z > 0)) {
    return Origin::kInvalid;
  }
  HalfDifference place = HalfDifference::of(omega_i, omega_o);
  if (content_.reciprocal && place.phi_d >= kPi) {
    place.phi_d -= kPi;
  }
  const auto scaled = [](double share, std::size_t count) { return share * static_cast<double>(count); };
  const Neighbours h = neighbours(scaled(std::sqrt(place.theta_h / (kPi / 2)), content_.theta_h_count),
                                  content_.theta_h_count, false);
  const Neighbours d =
      neighbours(scaled(place.theta_d / (kPi / 2), content_.theta_d_count), content_.theta_d_count, false);
  const Neighbours p = neighbours(scaled(place.phi_d / content_.phi_range(), content_.phi_d_count),
                                  content_.phi_d_count, true);
  const auto cell_of = [&](std::size_t i, std::size_t j, std::size_t k) {
    return (i * content_.theta_d_count + j) * content_.phi_d_count + k;
  };
  const std::size_t nearest = cell_of(h.nearest, d.nearest, p.nearest);
  if (!has_value(nearest)) {
    return Origin::kInvalid;
  }
  const auto at = [&](std::size_t channel, std::size_t cell) {
    return static_cast<double>(content_.f_per_sr[channel * content_.cells() + cell]);
  };
  if (lookup_ == Lookup::kNearest) {
    for (std::size_t c = 0; c < content_.channels; ++c) {
      f_per_sr[c] = at(c, nearest);
    }
    return Origin::kMeasured;
  }
  double total = 0;
  bool complete = true;
  for (std::size_t corner = 0; corner < 8; ++corner) {
    const double weight = ((corner & 1) != 0 ? h.share : 1 - h.share) *
                          ((corner & 2) != 0 ? d.share : 1 - d.share) *
                          ((corner & 4) != 0 ? p.share : 1 - p.share);
    if (!(weight > 0)) {
      continue;
    }
    const std::size_t cell =
        cell_of((corner & 1) != 0 ? h.above : h.below, (corner & 2) != 0 ? d.above : d.below,
                (corner & 4) != 0 ? p.above : p.below);
    if (!has_value(cell)) {
      complete = false;
      continue;
    }
    total += weight;
    for (std::size_t c = 0; c < content_.channels; ++c) {
      f_per_sr[c] += weight * at(c, cell);
    }
  }
  // The cell itself has a value and is among the corners, so total is not 0.
  for (double& f : f_per_sr) {
    f /= total;
  }
  return complete ? Origin::kMeasured : Origin::kExtrapolated;
}

}  // namespace scatter::reflectance
