#include "host_sdk/reflectance/estimators/scattered_brdf.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <unordered_map>

#include "host_sdk/reflectance/estimators/estimator.h"

namespace scatter::reflectance {
namespace {

constexpr ScatteredBrdf::SampleId kNone = std::numeric_limits<ScatteredBrdf::SampleId>::max();
/// Farther than a few roundings of a float apart, two places are two places.
constexpr float kSamePlaceSquared = 1e-12F;

struct PointHash {
  std::size_t operator()(const search::Point& p) const noexcept {
    // -0.0 equals 0.0, so both must hash alike: adding 0.0F makes them so.
    std::size_t h = 0;
    for (const float x : {p.x_i, p.y_i, p.x_o, p.y_o}) {
      h = h * 1099511628211U + std::hash<float>{}(x + 0.0F);
    }
    return h;
  }
};

/// One sample as a list of one, for `check`.
ScatteredSamples alone(const ScatteredSample& sample, ScatterType type, std::size_t channels) {
  ScatteredSamples one;
  one.type = type;
  one.channels = channels;
  one.omega_i = {sample.omega_i};
  one.omega_o = {sample.omega_o};
  one.f_per_sr.assign(sample.f_per_sr.begin(), sample.f_per_sr.end());
  one.random_per_sr.assign(sample.random_per_sr.begin(), sample.random_per_sr.end());
  one.systematic_per_sr.assign(sample.systematic_per_sr.begin(), sample.systematic_per_sr.end());
  one.origin = {sample.origin};
  return one;
}

void put(std::vector<float>& plane, std::size_t at, std::span<const float> values) {
  if (plane.size() < at + values.size()) {
    plane.resize(at + values.size());
  }
  std::ranges::copy(values, plane.begin() + static_cast<std::ptrdiff_t>(at));
}

}  // namespace

Result<std::shared_ptr<ScatteredBrdf>> ScatteredBrdf::make(ScatteredSamples samples) {
  if (Status status = check(samples); !status) {
    return std::unexpected(status.error());
  }
  if (samples.random_per_sr.empty() != samples.systematic_per_sr.empty()) {
    return fail(ErrorCode::kInvalidArgument, "samples: one kind of uncertainty without the other",
                "give random and systematic uncertainties, or neither");
  }
  if (samples.size() >= kNone) {
    return fail(ErrorCode::kResourceExhausted,
                fmt::format("samples: {} samples, expected at most {}", samples.size(), kNone - 1),
                "split the list");
  }
  std::shared_ptr<ScatteredBrdf> made(new ScatteredBrdf);
  made->samples_ = std::move(samples);
  ScatteredSamples& held = made->samples_;
  const std::size_t count = held.size();
  held.origin.resize(count, Origin::kMeasured);
  made->has_uncertainty_ = !held.random_per_sr.empty();
  made->is_live_.assign(count, true);
  made->next_.assign(count, kNone);
  made->live_ = count;
  std::unordered_map<search::Point, std::uint32_t, PointHash> seen;
  seen.reserve(count);
  std::vector<search::Point> points;
  for (std::size_t s = 0; s < count; ++s) {
    made->note_azimuth(held.omega_i[s]);
    if (held.origin[s] == Origin::kInvalid) {
      continue;
    }
    const search::Point at = search::point_of(held.omega_i[s], held.omega_o[s]);
    const auto [found, is_new] = seen.try_emplace(at, static_cast<std::uint32_t>(made->sites_.size()));
    if (is_new) {
      made->sites_.push_back({at, held.omega_i[s], held.omega_o[s], kNone, 0, Origin::kInvalid});
      points.push_back(at);
    }
    Site& site = made->sites_[found->second];
    made->next_[s] = site.first;
    site.first = static_cast<SampleId>(s);
    site.held += 1;
  }
  for (std::uint32_t site = 0; site < made->sites_.size(); ++site) {
    made->average(site);
  }
  Result<search::NeighborIndex> index = search::NeighborIndex::build(points);
  if (!index) {
    return std::unexpected(index.error());
  }
  made->index_ = std::move(*index);
  return made;
}

Result<ScatteredBrdf::SampleId> ScatteredBrdf::add(const ScatteredSample& sample) {
  if (Status status = check(alone(sample, type(), channels())); !status) {
    return std::unexpected(status.error());
  }
  const bool knows = !sample.random_per_sr.empty();
  if (knows != !sample.systematic_per_sr.empty() || (live_ > 0 && knows != has_uncertainty_)) {
    return fail(ErrorCode::kInvalidArgument,
                fmt::format("samples: the new sample has {} uncertainties, the others have {}",
                            knows ? "some" : "no", has_uncertainty_ ? "both" : "none"),
                "give every sample random and systematic uncertainties, or none");
  }
  if (free_.empty() && samples_.size() >= kNone - 1) {
    return fail(ErrorCode::kResourceExhausted, fmt::format("samples: {} samples are held", samples_.size()),
                "remove samples first");
  }
  SampleId id = static_cast<SampleId>(samples_.size());
  if (free_.empty()) {
    samples_.omega_i.push_back(sample.omega_i);
    samples_.omega_o.push_back(sample.omega_o);
    samples_.origin.push_back(sample.origin);
    is_live_.push_back(true);
    next_.push_back(kNone);
  } else {
    id = free_.back();
    free_.pop_back();
    samples_.omega_i[id] = sample.omega_i;
    samples_.omega_o[id] = sample.omega_o;
    samples_.origin[id] = sample.origin;
    is_live_[id] = true;
    next_[id] = kNone;
  }
  const std::size_t at = static_cast<std::size_t>(id) * channels();
  put(samples_.f_per_sr, at, sample.f_per_sr);
  has_uncertainty_ = knows;
  if (knows) {
    put(samples_.random_per_sr, at, sample.random_per_sr);
    put(samples_.systematic_per_sr, at, sample.systematic_per_sr);
  }
  live_ += 1;
  note_azimuth(sample.omega_i);
  if (sample.origin != Origin::kInvalid) {
    if (Status status = attach(id); !status) {
      return std::unexpected(status.error());
    }
  }
  return id;
}

Status ScatteredBrdf::attach(SampleId id) {
  const search::Point at = search::point_of(samples_.omega_i[id], samples_.omega_o[id]);
  std::optional<std::uint32_t> found = site_at(at);
  if (!found) {
    const bool reuse = !free_sites_.empty();
    found = reuse ? free_sites_.back() : static_cast<std::uint32_t>(sites_.size());
    if (Status status = index_.add(at, *found); !status) {
      return status;
    }
    if (reuse) {
      free_sites_.pop_back();
    } else {
      sites_.emplace_back();
    }
    sites_[*found] = {at, samples_.omega_i[id], samples_.omega_o[id], kNone, 0, Origin::kInvalid};
  }
  Site& site = sites_[*found];
  next_[id] = site.first;
  site.first = id;
  site.held += 1;
  average(*found);
  return {};
}

bool ScatteredBrdf::remove(SampleId id) {
  if (id >= is_live_.size() || !is_live_[id]) {
    return false;
  }
  if (samples_.origin[id] != Origin::kInvalid) {
    const search::Point at = search::point_of(samples_.omega_i[id], samples_.omega_o[id]);
    const std::uint32_t number = site_at(at).value();
    Site& site = sites_[number];
    SampleId* link = &site.first;
    while (*link != id) {
      link = &next_[*link];
    }
    *link = next_[id];
    site.held -= 1;
    if (site.held == 0) {
      index_.remove(at, number);
      free_sites_.push_back(number);
    } else {
      average(number);
    }
  }
  is_live_[id] = false;
  free_.push_back(id);
  live_ -= 1;
  return true;
}

void ScatteredBrdf::average(std::uint32_t site) {
  const std::size_t n = channels();
  const std::size_t end = (static_cast<std::size_t>(site) + 1) * n;
  Site& of = sites_[site];
  const auto mean = [&](const std::vector<float>& from, std::vector<float>& to) {
    to.resize(std::max(to.size(), end));
    for (std::size_t c = 0; c < n; ++c) {
      double total = 0;
      for (SampleId s = of.first; s != kNone; s = next_[s]) {
        total += static_cast<double>(from[s * n + c]);
      }
      to[end - n + c] = static_cast<float>(total / of.held);
    }
  };
  mean(samples_.f_per_sr, site_f_);
  if (has_uncertainty_) {
    mean(samples_.random_per_sr, site_random_);
    mean(samples_.systematic_per_sr, site_systematic_);
  }
  of.origin = Origin::kMeasured;
  for (SampleId s = of.first; s != kNone; s = next_[s]) {
    of.origin = combined(of.origin, samples_.origin[s]);
  }
}

ScatteredSamples ScatteredBrdf::samples() const {
  ScatteredSamples out;
  out.type = samples_.type;
  out.channels = samples_.channels;
  out.wavelengths_nm = samples_.wavelengths_nm;
  out.metadata = samples_.metadata;
  const auto append = [&](const std::vector<float>& from, std::vector<float>& to, std::size_t s) {
    const auto first = from.begin() + static_cast<std::ptrdiff_t>(s * channels());
    to.insert(to.end(), first, first + static_cast<std::ptrdiff_t>(channels()));
  };
  for (std::size_t s = 0; s < is_live_.size(); ++s) {
    if (!is_live_[s]) {
      continue;
    }
    out.omega_i.push_back(samples_.omega_i[s]);
    out.omega_o.push_back(samples_.omega_o[s]);
    out.origin.push_back(samples_.origin[s]);
    append(samples_.f_per_sr, out.f_per_sr, s);
    if (has_uncertainty_) {
      append(samples_.random_per_sr, out.random_per_sr, s);
      append(samples_.systematic_per_sr, out.systematic_per_sr, s);
    }
  }
  return out;
}

void ScatteredBrdf::note_azimuth(const Direction& omega_i) {
  if (std::hypot(omega_i.x, omega_i.y) <= kSameAngle) {
    return;
  }
  const double phi = phi_of(omega_i);
  if (!azimuth_seen_) {
    azimuth_ = phi;
    azimuth_seen_ = true;
  } else if (azimuth_ && std::cos(phi - *azimuth_) < std::cos(2 * kSameAngle)) {
    azimuth_.reset();
  }
}

ScatteredBrdf::Pair ScatteredBrdf::turned(const Direction& omega_i, const Direction& omega_o) const noexcept {
  const double sin_theta = std::hypot(omega_i.x, omega_i.y);
  if (!azimuth_ || sin_theta <= kSameAngle) {
    return {omega_i, omega_o};
  }
  const double cos_data = std::cos(*azimuth_);
  const double sin_data = std::sin(*azimuth_);
  const double cos_light = omega_i.x / sin_theta;
  const double sin_light = omega_i.y / sin_theta;
  const double c = cos_data * cos_light + sin_data * sin_light;
  const double s = sin_data * cos_light - cos_data * sin_light;
  return {{sin_theta * cos_data, sin_theta * sin_data, omega_i.z},
          {omega_o.x * c - omega_o.y * s, omega_o.x * s + omega_o.y * c, omega_o.z}};
}

std::optional<std::uint32_t> ScatteredBrdf::site_at(const search::Point& point) const {
  search::Neighbor found;
  if (index_.nearest(point, std::span(&found, 1)) == 0 || found.distance_squared != 0) {
    return std::nullopt;
  }
  return found.id;
}

std::optional<std::uint32_t> ScatteredBrdf::site_near(const Direction& omega_i,
                                                      const Direction& omega_o) const noexcept {
  const double up = type() == ScatterType::kBrdf ? omega_o.z : -omega_o.z;
  if (!(omega_i.z > 0 && up >= -kSameAngle)) {
    return std::nullopt;
  }
  const Pair at = turned(omega_i, omega_o);
  search::Neighbor found;
  if (index_.nearest(search::point_of(at.omega_i, at.omega_o), std::span(&found, 1)) == 0 ||
      !(found.distance_squared <= kSamePlaceSquared)) {
    return std::nullopt;
  }
  return found.id;
}

std::span<const float> ScatteredBrdf::random(std::uint32_t site) const noexcept {
  return has_uncertainty_ ? std::span(site_random_).subspan(site * channels(), channels())
                          : std::span<const float>();
}

std::span<const float> ScatteredBrdf::systematic(std::uint32_t site) const noexcept {
  return has_uncertainty_ ? std::span(site_systematic_).subspan(site * channels(), channels())
                          : std::span<const float>();
}

Origin ScatteredBrdf::eval(const Direction& omega_i, const Direction& omega_o,
                           std::span<double> f_per_sr) const noexcept {
  const std::optional<std::uint32_t> site = site_near(omega_i, omega_o);
  if (!site) {
    std::ranges::fill(f_per_sr, 0.0);
    return Origin::kInvalid;
  }
  std::ranges::copy(value(*site), f_per_sr.begin());
  return sites_[*site].origin;
}

bool ScatteredBrdf::uncertainty(const Direction& omega_i, const Direction& omega_o,
                                std::span<double> random_per_sr,
                                std::span<double> systematic_per_sr) const noexcept {
  const std::optional<std::uint32_t> site =
      has_uncertainty_ ? site_near(omega_i, omega_o) : std::optional<std::uint32_t>();
  if (!site) {
    return false;
  }
  std::ranges::copy(random(*site), random_per_sr.begin());
  std::ranges::copy(systematic(*site), systematic_per_sr.begin());
  return true;
}

std::vector<Direction> ScatteredBrdf::own_incidences() const {
  return incidences_of(samples());
}

}  // namespace scatter::reflectance
