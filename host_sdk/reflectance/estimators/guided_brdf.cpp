#include "host_sdk/reflectance/estimators/guided_brdf.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "host_sdk/reflectance/estimators/scratch.h"
#include "host_sdk/reflectance/grid_brdf.h"
#include "host_sdk/reflectance/specular_grid_brdf.h"

namespace scatter::reflectance {
namespace {

/// Points worked on at once: their intermediate values stay in the cache.
constexpr std::size_t kChunk = 128;
/// Rotations farther apart than this are not interpolated [rad]; as GridBrdf.
constexpr double kWidestRotationGap = kPi / 2 + kSameAngle;

const Brdf& data_of(const Brdf& brdf) {
  const auto* link = dynamic_cast<const Estimator*>(&brdf);
  return link == nullptr ? brdf : data_of(link->inner());
}

/// Nodes of the data where they are on a regular grid, so that measured values are met exactly.
GuidedGrid grid_of(const Brdf& brdf) {
  GuidedGrid grid;
  if (const auto* normal = dynamic_cast<const GridBrdf*>(&data_of(brdf))) {
    grid.theta_step = normal->content().theta_step;
    grid.phi_step = normal->content().phi_step;
    grid.columns = normal->content().phi_count;
    const auto most = static_cast<std::size_t>(kGuidedThetaTo / grid.theta_step + kSameAngle) + 1;
    grid.rows = std::max(std::min(normal->content().theta_count, most), std::size_t{2});
  }
  return grid;
}

/// Azimuths of the light on the sample, ascending.
std::vector<double> azimuths_of(const Brdf& brdf, const Extent& extent) {
  if (extent.azimuth) {
    return {*extent.azimuth};
  }
  std::vector<double> azimuths;
  if (const auto* normal = dynamic_cast<const GridBrdf*>(&data_of(brdf))) {
    // Parts are sorted by rotation and incidence: the last of a rotation is the steepest one.
    const std::vector<GridPart>& parts = normal->content().parts;
    for (std::size_t p = 0; p < parts.size(); ++p) {
      if (p + 1 == parts.size() || parts[p + 1].rotation_rad - parts[p].rotation_rad > kSameAngle) {
        azimuths.push_back(std::fmod(std::fmod(parts[p].phi_i, 2 * kPi) + 2 * kPi, 2 * kPi));
      }
    }
  } else if (const auto* specular = dynamic_cast<const SpecularGridBrdf*>(&data_of(brdf))) {
    azimuths = specular->content().rotation;
  } else {
    azimuths = {0.0};
  }
  std::ranges::sort(azimuths);
  return azimuths;
}

}  // namespace

Result<std::shared_ptr<const GuidedBrdf>> GuidedBrdf::make(std::shared_ptr<const Brdf> inner) {
  const Extent extent = extent_of(*inner);
  return make(std::move(inner), extent);
}

Result<std::shared_ptr<const GuidedBrdf>> GuidedBrdf::make(std::shared_ptr<const Brdf> inner,
                                                           const Extent& extent) {
  if (extent.theta_i.size() < 2) {
    return fail(ErrorCode::kFailedPrecondition,
                fmt::format("guided: the data has {} incidences, expected at least 2", extent.theta_i.size()),
                "leave the interpolation between incidences out, or measure more incidences");
  }
  for (std::size_t k = 0; k < extent.theta_i.size(); ++k) {
    const double theta_i = extent.theta_i[k];
    if (!(theta_i >= 0 && theta_i < kPi / 2) || (k > 0 && !(theta_i - extent.theta_i[k - 1] > kSameAngle))) {
      return fail(ErrorCode::kInvalidArgument,
                  fmt::format("guided: incidence {} is {:.6g} deg, expected ascending angles in 0..90", k,
                              degrees(theta_i)),
                  "give the incidences in ascending order");
    }
  }
  const std::vector<double> azimuths = azimuths_of(*inner, extent);
  const GuidedGrid grid = grid_of(*inner);
  std::vector<std::unique_ptr<Rotation>> rotations;
  for (const double azimuth : azimuths) {
    auto rotation = std::make_unique<Rotation>();
    auto data = gather_guided(*inner, grid, extent.theta_i, azimuth, azimuths.size() == 1);
    if (!data) {
      return std::unexpected(data.error());
    }
    rotation->data = std::move(*data);
    auto mixture = select_guided(rotation->data);
    if (!mixture) {
      return std::unexpected(mixture.error());
    }
    rotation->mixture = std::move(*mixture);
    std::vector<std::size_t> use(extent.theta_i.size());
    for (std::size_t k = 0; k < use.size(); ++k) {
      use[k] = k;
    }
    rotation->predictor.emplace(rotation->data, std::move(use), rotation->mixture.guides,
                                rotation->mixture.candidates);
    rotations.push_back(std::move(rotation));
  }
  const AngularRegion region{.theta_i_from = extent.theta_i.front(), .theta_i_to = extent.theta_i.back()};
  return std::shared_ptr<const GuidedBrdf>(
      new GuidedBrdf(std::move(inner), region, extent, std::move(rotations)));
}

GuidedBrdf::GuidedBrdf(std::shared_ptr<const Brdf> inner, const AngularRegion& region, const Extent& extent,
                       std::vector<std::unique_ptr<Rotation>> rotations)
    : Estimator(std::move(inner), region), extent_(extent), rotations_(std::move(rotations)) {}

std::vector<const GuidedMixture*> GuidedBrdf::mixtures() const {
  std::vector<const GuidedMixture*> all;
  for (const auto& rotation : rotations_) {
    all.push_back(&rotation->mixture);
  }
  return all;
}

std::optional<double> GuidedBrdf::cross_validation_error() const noexcept {
  double sum = 0;
  for (const auto& rotation : rotations_) {
    if (!rotation->mixture.error) {
      return std::nullopt;
    }
    sum += *rotation->mixture.error;
  }
  return sum / static_cast<double>(rotations_.size());
}

std::map<std::string, std::string> GuidedBrdf::metadata() const {
  std::string method;
  double specular = 0;
  for (const auto& rotation : rotations_) {
    method += fmt::format("{}guided", method.empty() ? "" : "; ");
    if (rotations_.size() > 1) {
      method += fmt::format(" at {:.6g} deg", degrees(rotation->data.azimuth));
    }
    for (const GuidedMember& member : rotation->mixture.members) {
      method += fmt::format("{} {} {:.0f} %", &member == rotation->mixture.members.data() ? ":" : ",",
                            member.name, 100 * member.weight);
    }
    specular += rotation->mixture.specular_error.value_or(0) / static_cast<double>(rotations_.size());
  }
  std::map<std::string, std::string> text{{"interpolation", method}};
  if (const auto error = cross_validation_error()) {
    text["interpolation_error"] = fmt::format("{:.3g}", *error);
    text["interpolation_error_specular_linear"] = fmt::format("{:.3g}", specular);
  } else {
    text["interpolation_error"] = "unknown: no incidence could be held back";
  }
  return text;
}

bool GuidedBrdf::stored(double theta_i) const noexcept {
  return std::ranges::any_of(extent_.theta_i,
                             [theta_i](double known) { return std::abs(known - theta_i) <= kSameAngle; });
}

Direction GuidedBrdf::asked(const Direction& w, double turn) const noexcept {
  if (!extent_.azimuth || turn == 0) {
    return w;
  }
  const double c = std::cos(turn);
  const double s = std::sin(turn);
  return {w.x * c - w.y * s, w.x * s + w.y * c, w.z};
}

std::vector<GuidedBrdf::Share> GuidedBrdf::rotations_at(double phi_i) const noexcept {
  if (rotations_.size() == 1) {
    return {{0, 1.0}};
  }
  std::size_t next = 0;
  while (next < rotations_.size() && rotations_[next]->data.azimuth < phi_i - kSameAngle) {
    ++next;
  }
  const std::size_t after = next % rotations_.size();
  const std::size_t before = (next + rotations_.size() - 1) % rotations_.size();
  const auto wrapped = [](double angle) {
    return angle < -kSameAngle ? angle + 2 * kPi : std::max(angle, 0.0);
  };
  const double to_after = wrapped(rotations_[after]->data.azimuth - phi_i);
  const double from_before = wrapped(phi_i - rotations_[before]->data.azimuth);
  if (to_after <= kSameAngle) {
    return {{after, 1.0}};
  }
  if (to_after + from_before > kWidestRotationGap) {
    return {{to_after < from_before ? after : before, 1.0}};
  }
  const double share = from_before / (to_after + from_before);
  return {{before, 1 - share}, {after, share}};
}

void GuidedBrdf::interpolate(const Rotation& rotation, double theta_i, double phi_i,
                             std::span<const Direction> omega_o, std::span<double> f_per_sr,
                             std::span<Origin> origin) const noexcept {
  const GuidedData& data = rotation.data;
  const GuidedPredictor& predictor = *rotation.predictor;
  const GuidedPredictor::Neighbors neighbors = predictor.neighbors(theta_i);
  const double c = std::cos(phi_i);
  const double s = std::sin(phi_i);
  const double side = data.type == ScatterType::kBrdf ? 1 : -1;
  const std::size_t n = data.channels;
  Scratch scratch;
  const std::span<Direction> local = scratch.take<Direction>(kChunk);
  const std::span<float> log_f = scratch.take<float>(predictor.candidates().size() * kChunk * n);
  const double last_theta = static_cast<double>(data.grid.rows - 1) * data.grid.theta_step + kSameAngle;
  for (std::size_t first = 0; first < omega_o.size(); first += kChunk) {
    const std::size_t count = std::min(kChunk, omega_o.size() - first);
    for (std::size_t k = 0; k < count; ++k) {
      const Direction& o = omega_o[first + k];
      local[k] = {o.x * c + o.y * s, o.y * c - o.x * s, std::max(side * o.z, 0.0)};
    }
    const std::span<const Direction> some = local.first(count);
    const std::span<float> logs = log_f.first(predictor.candidates().size() * count * n);
    predictor.predict(theta_i, some, logs);
    mix(rotation.mixture, theta_i, some, logs, n, f_per_sr.subspan(first * n, count * n));
    for (std::size_t k = 0; k < count; ++k) {
      const GuidedGrid::Cell cell = data.grid.locate(some[k]);
      const bool known = theta_of(some[k]) <= last_theta && data.measured[neighbors.below][cell.low] != 0 &&
                         data.measured[neighbors.above][cell.low] != 0;
      origin[first + k] = known ? Origin::kInterpolated : Origin::kExtrapolated;
    }
  }
}

void GuidedBrdf::estimate(const Direction& omega_i, std::span<const Direction> omega_o,
                          std::span<double> f_per_sr, std::span<Origin> origin) const noexcept {
  const double sin_i = std::hypot(omega_i.x, omega_i.y);
  const double theta_i = std::atan2(sin_i, omega_i.z);
  const double home = extent_.azimuth.value_or(0);
  // Light along the normal has no azimuth: the data's own is taken, as the grids do.
  const double phi_i = sin_i < kSameAngle ? home : phi_of(omega_i);
  Scratch scratch;
  if (stored(theta_i)) {
    const std::span<Direction> turned = scratch.take<Direction>(omega_o.size());
    for (std::size_t k = 0; k < omega_o.size(); ++k) {
      turned[k] = asked(omega_o[k], home - phi_i);
    }
    inner().eval_batch(asked(omega_i, home - phi_i), turned, f_per_sr, origin);
    return;
  }
  const std::vector<Share> shares = rotations_at(phi_i);
  interpolate(*rotations_[shares[0].rotation], theta_i, phi_i, omega_o, f_per_sr, origin);
  if (shares.size() > 1) {
    const std::span<double> other = scratch.take<double>(f_per_sr.size());
    const std::span<Origin> other_origin = scratch.take<Origin>(origin.size());
    interpolate(*rotations_[shares[1].rotation], theta_i, phi_i, omega_o, other, other_origin);
    for (std::size_t k = 0; k < f_per_sr.size(); ++k) {
      f_per_sr[k] = shares[0].share * f_per_sr[k] + shares[1].share * other[k];
    }
    for (std::size_t k = 0; k < origin.size(); ++k) {
      origin[k] = combined(origin[k], other_origin[k]);
    }
  }
}

bool GuidedBrdf::estimate_uncertainty(const Direction& omega_i, const Direction& omega_o,
                                      std::span<double> random_per_sr,
                                      std::span<double> systematic_per_sr) const noexcept {
  const double sin_i = std::hypot(omega_i.x, omega_i.y);
  const double theta_i = std::atan2(sin_i, omega_i.z);
  const double home = extent_.azimuth.value_or(0);
  const double phi_i = sin_i < kSameAngle ? home : phi_of(omega_i);
  const Direction turned_o = asked(omega_o, home - phi_i);
  if (stored(theta_i)) {
    return inner().uncertainty(asked(omega_i, home - phi_i), turned_o, random_per_sr, systematic_per_sr);
  }
  const Rotation& rotation = *rotations_[rotations_at(phi_i)[0].rotation];
  const GuidedPredictor::Neighbors neighbors = rotation.predictor->neighbors(theta_i);
  const std::size_t n = channels();
  Scratch scratch;
  const std::span<double> f = scratch.take<double>(n);
  std::array<Origin, 1> origin{};
  estimate(omega_i, std::span(&omega_o, 1), f, origin);
  std::array<std::span<double>, 2> value;
  std::array<std::span<double>, 2> random;
  std::array<std::span<double>, 2> systematic;
  for (std::size_t k = 0; k < 2; ++k) {
    value[k] = scratch.take<double>(n);
    random[k] = scratch.take<double>(n);
    systematic[k] = scratch.take<double>(n);
    const double theta = extent_.theta_i[k == 0 ? neighbors.below : neighbors.above];
    const Direction there = from_spherical(theta, extent_.azimuth.value_or(phi_i));
    if (inner().eval(there, turned_o, value[k]) == Origin::kInvalid ||
        !inner().uncertainty(there, turned_o, random[k], systematic[k])) {
      return false;
    }
  }
  const double s = neighbors.share;
  const GuidedRegions regions(theta_i);
  const double side = type() == ScatterType::kBrdf ? 1 : -1;
  const Direction local{omega_o.x * std::cos(phi_i) + omega_o.y * std::sin(phi_i),
                        omega_o.y * std::cos(phi_i) - omega_o.x * std::sin(phi_i), side * omega_o.z};
  const double method = 4 * s * (1 - s) * rotation.mixture.region_rms[regions.nearest(local)];
  for (std::size_t c = 0; c < n; ++c) {
    const double low = (1 - s) * f[c] / std::max(value[0][c], rotation.data.floor_per_sr[c]);
    const double high = s * f[c] / std::max(value[1][c], rotation.data.floor_per_sr[c]);
    random_per_sr[c] = std::hypot(low * random[0][c], high * random[1][c]);
    systematic_per_sr[c] = std::hypot(low * systematic[0][c] + high * systematic[1][c], method * f[c]);
  }
  return true;
}

}  // namespace scatter::reflectance
