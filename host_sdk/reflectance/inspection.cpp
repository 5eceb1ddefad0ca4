#include "host_sdk/reflectance/inspection.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "host_sdk/reflectance/grid_brdf.h"
#include "host_sdk/reflectance/specular_grid_brdf.h"

namespace scatter::reflectance {
namespace {

constexpr std::size_t kRows = 91;
constexpr std::size_t kColumns = 360;
constexpr double kStep = kPi / 180;
constexpr double kReciprocityStep = radians(5);
/// Incidences closer than this have no reciprocal pair that says more than mirror symmetry [rad].
constexpr double kSameAngle = 1e-6;
/// Stated and recomputed totals that differ by more do not agree (formats.md 1).
constexpr double kTotalsAgree = 0.05;

/// Lists and tables of many incidences are judged at this many of them.
constexpr std::size_t kMostIncidences = 64;
/// What knows all incidences alike gains energy at grazing ones if anywhere [deg].
constexpr std::array<double, 3> kGrazing{75, 85, 88};

/// Less of the hemisphere than this does not tell an albedo.
constexpr double kLeastKnown = 0.01;

bool has_value(Origin origin) noexcept {
  return origin == Origin::kMeasured || origin == Origin::kInterpolated;
}

/// Directions every degree about the normal and the solid angles that they stand for.
struct Hemisphere {
  std::vector<Direction> omega_o;
  std::vector<double> solid_angle_sr;

  explicit Hemisphere(ScatterType type) {
    for (std::size_t j = 0; j < kRows; ++j) {
      const double theta = static_cast<double>(j) * kStep;
      const double low = std::max(0.0, theta - kStep / 2);
      const double high = std::min(kPi / 2, theta + kStep / 2);
      for (std::size_t i = 0; i < kColumns; ++i) {
        Direction w = from_spherical(theta, static_cast<double>(i) * kStep);
        w.z = type == ScatterType::kBtdf ? -w.z : w.z;
        omega_o.push_back(w);
        solid_angle_sr.push_back(kStep * 2 * std::sin((low + high) / 2) * std::sin((high - low) / 2));
      }
    }
  }
};

class Differences {
 public:
  void add(double a, double b, double weight = 1) {
    const double mean = (a + b) / 2;
    squares_ += weight * (a - b) * (a - b);
    mean_squares_ += weight * mean * mean;
    if (mean > 0) {
      relative_.emplace_back(std::abs(a - b) / mean, weight);
    }
  }
  void add_pair() { ++pairs_; }
  void add(const Differences& other) {
    squares_ += other.squares_;
    mean_squares_ += other.mean_squares_;
    pairs_ += other.pairs_;
    relative_.insert(relative_.end(), other.relative_.begin(), other.relative_.end());
  }

  [[nodiscard]] std::optional<Deviation> result() {
    if (pairs_ == 0) {
      return std::nullopt;
    }
    Deviation out;
    out.relative_rms = mean_squares_ > 0 ? std::sqrt(squares_ / mean_squares_) : 0;
    out.pairs = pairs_;
    std::ranges::sort(relative_);
    const double half = std::accumulate(relative_.begin(), relative_.end(), 0.0,
                                        [](double sum, const auto& r) { return sum + r.second; }) /
                        2;
    double below = 0;
    for (const auto& [value, weight] : relative_) {
      below += weight;
      if (below >= half) {
        out.median = value;
        break;
      }
    }
    return out;
  }

 private:
  double squares_ = 0;
  double mean_squares_ = 0;
  std::size_t pairs_ = 0;
  std::vector<std::pair<double, double>> relative_;  ///< (relative difference, weight)
};

class Inspector {
 public:
  Inspector(const Brdf& brdf, const InspectionOptions& options)
      : brdf_(brdf),
        options_(options),
        hemisphere_(brdf.type()),
        channels_(brdf.channels()),
        f_(hemisphere_.omega_o.size() * channels_),
        origin_(hemisphere_.omega_o.size()) {}

  IncidenceInspection at(const Direction& omega_i) {
    IncidenceInspection out = energy_at(omega_i);
    symmetry(omega_i, out);
    return out;
  }

  /// The albedo and no more.
  IncidenceInspection energy_at(const Direction& omega_i) {
    IncidenceInspection out;
    out.theta_i = theta_of(omega_i);
    out.phi_i = phi_of(omega_i);
    brdf_.eval_batch(omega_i, hemisphere_.omega_o, f_, origin_);
    const bool shines = share(out);
    energy(omega_i, out);
    const auto dark = [](const std::vector<double>& values) {
      return std::ranges::all_of(values, [](double value) { return value == 0; });
    };
    out.nothing_known =
        dark(out.albedo.dirac) && (1 - out.coverage[0] < kLeastKnown || (shines && dark(out.albedo.value)));
    return out;
  }

  std::optional<Deviation> whole_symmetry() { return symmetry_.result(); }

 private:
  /// True where some direction of the hemisphere has a value other than 0.
  bool share(IncidenceInspection& out) const {
    std::vector<double> all(channels_, 0.0);
    std::vector<double> extrapolated(channels_, 0.0);
    for (std::size_t n = 0; n < origin_.size(); ++n) {
      out.coverage.at(static_cast<std::size_t>(origin_[n])) += hemisphere_.solid_angle_sr[n] / (2 * kPi);
      const double weight = hemisphere_.solid_angle_sr[n] * std::abs(hemisphere_.omega_o[n].z);
      for (std::size_t c = 0; c < channels_; ++c) {
        all[c] += weight * f_[n * channels_ + c];
        extrapolated[c] += origin_[n] == Origin::kExtrapolated ? weight * f_[n * channels_ + c] : 0;
      }
    }
    const auto largest = static_cast<std::size_t>(std::ranges::max_element(all) - all.begin());
    out.extrapolated_albedo_share = all[largest] > 0 ? extrapolated[largest] / all[largest] : 0;
    return std::ranges::any_of(f_, [](double f) { return f != 0; });
  }

  void energy(const Direction& omega_i, IncidenceInspection& out) const {
    out.albedo = albedo(brdf_, omega_i, {.tolerance = options_.albedo_tolerance});
    for (std::size_t c = 0; c < channels_; ++c) {
      out.gains_energy = out.gains_energy || out.albedo.value[c] + out.albedo.dirac[c] - out.albedo.error > 1;
    }
  }

  void symmetry(const Direction& omega_i, IncidenceInspection& out) {
    // Reflection at the plane that holds the normal and omega_i; at normal incidence every plane does.
    const double sin_i = std::hypot(omega_i.x, omega_i.y);
    if (sin_i < kSameAngle) {
      return;
    }
    const Direction across{-omega_i.y / sin_i, omega_i.x / sin_i, 0};
    std::vector<Direction> other;
    other.reserve(origin_.size());
    for (const Direction& w : hemisphere_.omega_o) {
      const double side = 2 * dot(w, across);
      other.push_back({w.x - side * across.x, w.y - side * across.y, w.z});
    }
    std::vector<double> f(f_.size());
    std::vector<Origin> origin(origin_.size());
    brdf_.eval_batch(omega_i, other, f, origin);
    Differences differences;
    for (std::size_t n = 0; n < origin_.size(); ++n) {
      // One half stands for both; what lies in the plane is its own mirror image.
      if (!(dot(hemisphere_.omega_o[n], across) > kSameAngle) || !has_value(origin_[n]) ||
          !has_value(origin[n])) {
        continue;
      }
      differences.add_pair();
      for (std::size_t c = 0; c < channels_; ++c) {
        differences.add(f_[n * channels_ + c], f[n * channels_ + c], hemisphere_.solid_angle_sr[n]);
      }
    }
    symmetry_.add(differences);
    out.mirror_symmetry = differences.result();
  }

  const Brdf& brdf_;
  const InspectionOptions& options_;
  Hemisphere hemisphere_;
  std::size_t channels_;
  std::vector<double> f_;
  std::vector<Origin> origin_;
  Differences symmetry_;
};

std::optional<Deviation> reciprocity(const Brdf& brdf, const std::vector<Direction>& incidences) {
  if (brdf.type() != ScatterType::kBrdf) {
    return std::nullopt;
  }
  std::vector<Direction> here;
  std::vector<Direction> there;
  for (const Direction& a : incidences) {
    for (const Direction& b : incidences) {
      const double theta_b = theta_of(b);
      if (!(theta_b > theta_of(a) + kSameAngle)) {
        continue;
      }
      for (double turn = 0; turn < 2 * kPi - kSameAngle; turn += kReciprocityStep) {
        here.push_back(a);
        there.push_back(from_spherical(theta_b, phi_of(a) + turn));
      }
    }
  }
  const std::size_t channels = brdf.channels();
  std::vector<double> forward(here.size() * channels);
  std::vector<double> backward(here.size() * channels);
  std::vector<Origin> forward_origin(here.size());
  std::vector<Origin> backward_origin(here.size());
  brdf.eval_pairs(here, there, forward, forward_origin);
  brdf.eval_pairs(there, here, backward, backward_origin);
  Differences differences;
  for (std::size_t k = 0; k < here.size(); ++k) {
    if (!has_value(forward_origin[k]) || !has_value(backward_origin[k])) {
      continue;
    }
    differences.add_pair();
    for (std::size_t c = 0; c < channels; ++c) {
      differences.add(forward[k * channels + c], backward[k * channels + c]);
    }
  }
  return differences.result();
}

/// Of one block of a file, per channel.
std::vector<StatedTotal> totals(const SpecularGridBrdf& grid, std::size_t rotation, std::size_t incidence) {
  const SpecularGridBrdf::Content& content = grid.content();
  std::vector<StatedTotal> out;
  for (std::size_t c = 0; c < content.stated_total.size(); ++c) {
    StatedTotal total;
    total.channel = c;
    total.stated = content.stated_total[c][rotation * content.theta_i.size() + incidence];
    total.recomputed = grid.integral(c, rotation, incidence);
    total.held = grid.integral(c, rotation, incidence, true);
    total.unweighted = grid.integral(c, rotation, incidence, false, false);
    total.ratio = total.stated != 0 ? total.recomputed / total.stated : 0;
    total.differs = !(std::abs(total.recomputed - total.stated) <= kTotalsAgree * std::abs(total.stated));
    out.push_back(total);
  }
  return out;
}

bool cosine_weighted(const std::vector<IncidenceInspection>& incidences) {
  std::size_t blocks = 0;
  std::size_t plain = 0;
  std::size_t weighted = 0;
  for (const IncidenceInspection& incidence : incidences) {
    for (const StatedTotal& total : incidence.totals) {
      ++blocks;
      plain += std::abs(total.unweighted - total.stated) <= kTotalsAgree * std::abs(total.stated) ? 1 : 0;
      weighted += total.differs ? 0 : 1;
    }
  }
  return 2 * plain > blocks && plain > 2 * weighted;
}

}  // namespace

std::vector<double> whole_albedo(const IncidenceInspection& incidence) {
  std::vector<double> whole = incidence.albedo.value;
  for (std::size_t c = 0; c < whole.size() && c < incidence.albedo.dirac.size(); ++c) {
    whole[c] += incidence.albedo.dirac[c];
  }
  return whole;
}

void EnergyBalance::add(const IncidenceInspection& incidence) {
  judged_to = std::max(judged_to, incidence.theta_i);
  if (incidence.nothing_known) {
    return;
  }
  const double albedo = std::ranges::max(whole_albedo(incidence));
  if (!largest_albedo || albedo > *largest_albedo) {
    largest_albedo = albedo;
    largest_at = incidence.theta_i;
  }
  gained = gained || incidence.gains_energy;
}

std::vector<Direction> measured_incidences(const Brdf& brdf) {
  std::vector<Direction> out = brdf.own_incidences();
  if (out.empty()) {
    for (const double theta_deg : {0.0, 20.0, 40.0, 60.0}) {
      out.push_back(from_spherical(radians(theta_deg), 0));
    }
  }
  return out;
}

std::vector<Direction> thinned(const std::vector<Direction>& incidences, std::size_t most) {
  if (incidences.size() <= most || most == 0) {
    return incidences;
  }
  std::vector<Direction> out;
  for (std::size_t k = 0; k < most; ++k) {
    out.push_back(incidences[most == 1 ? 0 : k * (incidences.size() - 1) / (most - 1)]);
  }
  return out;
}

Inspection inspect(const Brdf& brdf, const InspectionOptions& options) {
  const auto* grid = dynamic_cast<const GridBrdf*>(&brdf);
  const auto* specular = dynamic_cast<const SpecularGridBrdf*>(&brdf);
  const bool own = options.incidences.empty();
  std::vector<Direction> incidences = own ? measured_incidences(brdf) : options.incidences;
  Inspector inspector(brdf, options);
  Inspection out;
  out.available_incidences = incidences.size();
  if (own && grid == nullptr && specular == nullptr) {
    incidences = thinned(incidences, kMostIncidences);
  }
  for (std::size_t k = 0; k < incidences.size(); ++k) {
    IncidenceInspection incidence = inspector.at(incidences[k]);
    if (own && grid != nullptr) {
      incidence.rotation_rad = grid->content().parts[k].rotation_rad;
      incidence.phi_i = grid->content().parts[k].phi_i;
    } else if (own && specular != nullptr) {
      const std::size_t count = specular->content().theta_i.size();
      incidence.rotation_rad = specular->content().rotation[k / count];
      incidence.phi_i = incidence.rotation_rad;
      incidence.totals = totals(*specular, k / count, k % count);
    }
    for (std::size_t s = 0; s < out.origin_shares.size(); ++s) {
      out.origin_shares.at(s) += incidence.coverage.at(s) / static_cast<double>(incidences.size());
    }
    out.energy.add(incidence);
    out.incidences.push_back(std::move(incidence));
  }
  if (own && brdf.own_incidences().empty()) {
    for (const double theta_deg : kGrazing) {
      out.energy.add(inspector.energy_at(from_spherical(radians(theta_deg), 0)));
    }
  }
  out.gains_energy = out.energy.gained;
  out.reciprocity = reciprocity(brdf, incidences);
  out.mirror_symmetry = inspector.whole_symmetry();
  out.looks_cosine_weighted = cosine_weighted(out.incidences);
  return out;
}

}  // namespace scatter::reflectance
