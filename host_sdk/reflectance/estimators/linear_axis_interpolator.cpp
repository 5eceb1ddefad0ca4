#include "host_sdk/reflectance/estimators/linear_axis_interpolator.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

namespace scatter::reflectance {
namespace {

/// Angles of one ring or incidence agree this well [rad]: files round to 1e-3 deg and better.
constexpr double kSameAxis = 1e-5;

double wrapped(double phi) noexcept {
  phi = std::fmod(phi, 2 * kPi);
  return phi < 0 ? phi + 2 * kPi : phi;
}

/// The element whose key lies within kSameAxis of the wanted one, made at its place when there is none.
template <typename Element, typename Key>
Element& at_key(std::vector<Element>& sorted, Key Element::* key, double wanted) {
  auto place = std::ranges::lower_bound(sorted, wanted - kSameAxis, {}, key);
  if (place == sorted.end() || (*place).*key > wanted + kSameAxis) {
    place = sorted.insert(place, Element{});
    (*place).*key = wanted;
  }
  return *place;
}

/// Neighbours on an open axis; below == above at an element.
struct Bracket {
  std::size_t below = 0;
  std::size_t above = 0;
  double share = 0;  ///< Of the upper one.
  double gap = 0;
  bool inside = false;
};

template <typename Element, typename Key>
Bracket bracket(const std::vector<Element>& sorted, Key Element::* key, double wanted) noexcept {
  Bracket found;
  const auto place = std::ranges::lower_bound(sorted, wanted - kSameAxis, {}, key);
  if (place == sorted.end()) {
    return found;
  }
  found.above = static_cast<std::size_t>(place - sorted.begin());
  found.below = found.above;
  const double above = (*place).*key;
  if (above <= wanted + kSameAxis) {
    found.inside = true;
    return found;
  }
  if (found.above == 0) {
    return found;
  }
  found.below = found.above - 1;
  const double below = sorted[found.below].*key;
  found.gap = above - below;
  found.share = (wanted - below) / found.gap;
  found.inside = true;
  return found;
}

/// The same on a circle of 2 pi; one element alone is its own neighbour all the way round.
template <typename Element, typename Key>
Bracket bracket_round(const std::vector<Element>& sorted, Key Element::* key, double wanted) noexcept {
  Bracket found;
  found.inside = true;
  const auto place = std::ranges::lower_bound(sorted, wanted - kSameAxis, {}, key);
  const std::size_t next = static_cast<std::size_t>(place - sorted.begin()) % sorted.size();
  const std::size_t before = (next + sorted.size() - 1) % sorted.size();
  const double to_next = wrapped(sorted[next].*key - wanted + kSameAxis) - kSameAxis;
  found.above = next;
  found.below = next;
  if (to_next <= kSameAxis) {
    return found;
  }
  const double from_before = wrapped(wanted - sorted[before].*key);
  found.below = before;
  if (from_before <= kSameAxis) {
    found.above = before;
    return found;
  }
  found.gap = from_before + to_next;
  found.share = from_before / found.gap;
  return found;
}

}  // namespace

/// At most two of everything: incidences, lights, rings, azimuths.
class LinearAxisInterpolator::Taps {
 public:
  void add(std::uint32_t site, double weight) noexcept { taps_[count_++] = {site, weight}; }
  [[nodiscard]] std::span<const Tap> all() const noexcept { return std::span(taps_).first(count_); }
  void clear() noexcept { count_ = 0; }

 private:
  std::array<Tap, 16> taps_;
  std::size_t count_ = 0;
};

Result<std::shared_ptr<const LinearAxisInterpolator>> LinearAxisInterpolator::make(
    std::shared_ptr<const ScatteredBrdf> samples, const Options& options) {
  if (!(options.widest_gap > 0 && options.widest_turn > 0)) {
    return fail(ErrorCode::kInvalidArgument,
                fmt::format("axis: widest gap {} deg, widest turn {} deg, expected > 0",
                            degrees(options.widest_gap), degrees(options.widest_turn)),
                "correct the option");
  }
  return std::shared_ptr<const LinearAxisInterpolator>(
      new LinearAxisInterpolator(std::move(samples), options));
}

LinearAxisInterpolator::LinearAxisInterpolator(std::shared_ptr<const ScatteredBrdf> samples,
                                               const Options& options)
    : Estimator(samples, options.region), samples_(std::move(samples)), options_(options) {
  const std::span<const ScatteredBrdf::Site> sites = samples_->sites();
  for (std::uint32_t s = 0; s < sites.size(); ++s) {
    const ScatteredBrdf::Site& site = sites[s];
    if (site.held == 0) {
      continue;
    }
    const double theta_i = theta_of(site.omega_i);
    const bool normal = theta_i <= kSameAxis;
    Incidence& incidence = at_key(incidences_, &Incidence::theta_i, theta_i);
    Light& light = at_key(incidence.lights, &Light::phi_i, normal ? 0.0 : phi_of(site.omega_i));
    Ring& ring = at_key(light.rings, &Ring::theta_o, exit_theta(type(), site.omega_o));
    ring.azimuths.push_back({wrapped(phi_of(site.omega_o) - light.phi_i), s});
  }
  for (Incidence& incidence : incidences_) {
    for (Light& light : incidence.lights) {
      for (Ring& ring : light.rings) {
        std::ranges::sort(ring.azimuths, {}, &Azimuth::phi);
      }
    }
  }
}

bool LinearAxisInterpolator::add_ring(const Ring& ring, double phi, double weight,
                                      Taps& taps) const noexcept {
  if (weight == 0) {
    return true;
  }
  if (ring.theta_o <= kSameAxis) {
    taps.add(ring.azimuths.front().site, weight);
    return true;
  }
  const Bracket found = bracket_round(ring.azimuths, &Azimuth::phi, phi);
  if (found.gap > options_.widest_gap + kSameAxis) {
    return false;
  }
  taps.add(ring.azimuths[found.below].site, weight * (1 - found.share));
  if (found.share > 0) {
    taps.add(ring.azimuths[found.above].site, weight * found.share);
  }
  return true;
}

bool LinearAxisInterpolator::add_light(const Light& light, double theta_o, double phi, double weight,
                                       Taps& taps) const noexcept {
  const Bracket found = bracket(light.rings, &Ring::theta_o, theta_o);
  return found.inside && found.gap <= options_.widest_gap + kSameAxis &&
         add_ring(light.rings[found.below], phi, weight * (1 - found.share), taps) &&
         add_ring(light.rings[found.above], phi, weight * found.share, taps);
}

bool LinearAxisInterpolator::add_incidence(const Incidence& incidence, double phi_i, double theta_o,
                                           double phi_o, double weight, Taps& taps) const noexcept {
  if (weight == 0) {
    return true;
  }
  if (incidence.theta_i <= kSameAxis) {
    return add_light(incidence.lights.front(), theta_o, wrapped(phi_o), weight, taps);
  }
  const double phi = wrapped(phi_o - phi_i);
  if (samples_->azimuth()) {
    return add_light(incidence.lights.front(), theta_o, phi, weight, taps);
  }
  const Bracket found = bracket_round(incidence.lights, &Light::phi_i, phi_i);
  if (found.gap > options_.widest_turn + kSameAxis) {
    return false;
  }
  if (!add_light(incidence.lights[found.below], theta_o, phi, weight * (1 - found.share), taps)) {
    return false;
  }
  return found.share == 0 ||
         add_light(incidence.lights[found.above], theta_o, phi, weight * found.share, taps);
}

LinearAxisInterpolator::Taps LinearAxisInterpolator::taps_at(const Direction& omega_i,
                                                             const Direction& omega_o) const noexcept {
  Taps taps;
  const ScatteredBrdf::Pair at = samples_->turned(omega_i, omega_o);
  const double theta_o = exit_theta(type(), at.omega_o);
  const double phi_i = phi_of(at.omega_i);
  const double phi_o = phi_of(at.omega_o);
  const Bracket found = bracket(incidences_, &Incidence::theta_i, theta_of(at.omega_i));
  if (!found.inside ||
      !add_incidence(incidences_[found.below], phi_i, theta_o, phi_o, 1 - found.share, taps) ||
      !add_incidence(incidences_[found.above], phi_i, theta_o, phi_o, found.share, taps)) {
    taps.clear();
  }
  return taps;
}

void LinearAxisInterpolator::estimate(const Direction& omega_i, std::span<const Direction> omega_o,
                                      std::span<double> f_per_sr, std::span<Origin> origin) const noexcept {
  const std::size_t n = channels();
  std::ranges::fill(f_per_sr, 0.0);
  for (std::size_t q = 0; q < omega_o.size(); ++q) {
    const Taps taps = taps_at(omega_i, omega_o[q]);
    const std::span<const Tap> all = taps.all();
    origin[q] = all.empty() ? Origin::kInvalid : all.size() == 1 ? Origin::kMeasured : Origin::kInterpolated;
    for (const Tap& tap : all) {
      origin[q] = combined(origin[q], samples_->sites()[tap.site].origin);
      const std::span<const float> value = samples_->value(tap.site);
      for (std::size_t c = 0; c < n; ++c) {
        f_per_sr[q * n + c] += tap.weight * static_cast<double>(value[c]);
      }
    }
  }
}

bool LinearAxisInterpolator::estimate_uncertainty(const Direction& omega_i, const Direction& omega_o,
                                                  std::span<double> random_per_sr,
                                                  std::span<double> systematic_per_sr) const noexcept {
  if (!samples_->has_uncertainty()) {
    return false;
  }
  const Taps taps = taps_at(omega_i, omega_o);
  if (taps.all().empty()) {
    return false;
  }
  std::ranges::fill(random_per_sr, 0.0);
  std::ranges::fill(systematic_per_sr, 0.0);
  for (const Tap& tap : taps.all()) {
    for (std::size_t c = 0; c < channels(); ++c) {
      random_per_sr[c] += tap.weight * static_cast<double>(samples_->random(tap.site)[c]);
      systematic_per_sr[c] += tap.weight * static_cast<double>(samples_->systematic(tap.site)[c]);
    }
  }
  return true;
}

}  // namespace scatter::reflectance
