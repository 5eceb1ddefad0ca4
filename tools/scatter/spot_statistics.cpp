#include "tools/scatter/spot_statistics.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "host_sdk/reflectance/direction.h"

namespace scatter::cli {
namespace {

using measurement::Measurement;
using reflectance::GridBrdf;
using reflectance::GridPart;
using reflectance::Origin;

constexpr double kPeakRadius = reflectance::radians(2);
constexpr double kDiffuseFrom = reflectance::radians(45);

/// Weighted mean of measured nodes.
struct NodeMean {
  double weight = 0, sum = 0, uncertainty = 0;

  void add(double w, double f, double own) noexcept {
    weight += w;
    sum += w * f;
    uncertainty += w * own;
  }
  [[nodiscard]] std::optional<SpotFigure> figure() const noexcept {
    return weight > 0 ? std::optional(SpotFigure{sum / weight, uncertainty / weight}) : std::nullopt;
  }
};

double random_at(const GridPart& part, std::size_t channel, std::size_t node) noexcept {
  return channel < part.random_per_sr.size() ? double{part.random_per_sr[channel][node]} : 0.0;
}

double systematic_at(const GridPart& part, std::size_t channel, std::size_t node) noexcept {
  return channel < part.systematic_per_sr.size() ? double{part.systematic_per_sr[channel][node]} : 0.0;
}

bool same_grid(const GridBrdf::Content& a, const GridBrdf::Content& b) noexcept {
  if (a.type != b.type || a.channels != b.channels || a.theta_count != b.theta_count ||
      a.phi_count != b.phi_count || a.parts.size() != b.parts.size()) {
    return false;
  }
  for (std::size_t k = 0; k < a.parts.size(); ++k) {
    const GridPart& p = a.parts[k];
    const GridPart& q = b.parts[k];
    if (p.theta_i != q.theta_i || p.phi_i != q.phi_i || p.rotation_rad != q.rotation_rad ||
        p.random_per_sr.empty() != q.random_per_sr.empty() ||
        p.systematic_per_sr.empty() != q.systematic_per_sr.empty()) {
      return false;
    }
  }
  return true;
}

/// One node of one channel over all spots.
void combine_node(std::span<const GridBrdf* const> spots, std::size_t part, std::size_t channel,
                  std::size_t node, GridPart& mean, GridPart& deviation) {
  const auto count = static_cast<double>(spots.size());
  double sum = 0;
  double variance = 0;
  double systematic = 0;
  for (const GridBrdf* spot : spots) {
    const GridPart& p = spot->content().parts[part];
    sum += double{p.f_per_sr[channel][node]};
    const double random = random_at(p, channel, node);
    variance += random * random;
    systematic += systematic_at(p, channel, node);
  }
  const double middle = sum / count;
  double squares = 0;
  for (const GridBrdf* spot : spots) {
    const double off = double{spot->content().parts[part].f_per_sr[channel][node]} - middle;
    squares += off * off;
  }
  const bool valid = mean.origin[node] != Origin::kInvalid;
  mean.f_per_sr[channel][node] = valid ? static_cast<float>(middle) : 0.0F;
  deviation.f_per_sr[channel][node] =
      valid && count > 1 ? static_cast<float>(std::sqrt(squares / (count - 1))) : 0.0F;
  if (!mean.random_per_sr.empty()) {
    mean.random_per_sr[channel][node] = static_cast<float>(std::sqrt(variance) / count);
  }
  if (!mean.systematic_per_sr.empty()) {
    mean.systematic_per_sr[channel][node] = static_cast<float>(systematic / count);
  }
}

int severity(measurement::Verdict verdict) noexcept {
  switch (verdict) {
    case measurement::Verdict::kFail:
      return 3;
    case measurement::Verdict::kWarn:
      return 2;
    case measurement::Verdict::kCannotTell:
      return 1;
    case measurement::Verdict::kOk:
      break;
  }
  return 0;
}

}  // namespace

std::vector<SpotFigures> spot_figures(const GridBrdf& brdf, std::size_t part) {
  const GridPart& p = brdf.content().parts[part];
  const bool below = brdf.type() == reflectance::ScatterType::kBtdf;
  const reflectance::Direction in = brdf.omega_i(part);
  const reflectance::Direction straight =
      below ? reflectance::Direction{-in.x, -in.y, -in.z} : reflectance::mirrored(in);
  std::vector<NodeMean> peak(brdf.channels());
  std::vector<NodeMean> diffuse(brdf.channels());
  std::vector<NodeMean> albedo(brdf.channels());
  std::vector<NodeMean> aside(brdf.channels());
  for (std::size_t node = 0; node < p.origin.size(); ++node) {
    if (p.origin[node] != Origin::kMeasured) {
      continue;
    }
    const reflectance::Direction out = brdf.omega_o(node);
    const double solid = brdf.solid_angle_sr(node);
    const double off = reflectance::angle_between(out, straight);
    for (std::size_t c = 0; c < brdf.channels(); ++c) {
      const double f = double{p.f_per_sr[c][node]};
      const double own = std::hypot(random_at(p, c, node), systematic_at(p, c, node));
      albedo[c].add(solid * std::abs(out.z), f, own);
      if (off <= kPeakRadius) {
        peak[c].add(solid, f, own);
      } else if (off >= kDiffuseFrom) {
        aside[c].add(solid * std::abs(out.z), f, own);
        diffuse[c].add(solid, f, own);
      }
    }
  }
  std::vector<SpotFigures> figures(brdf.channels());
  for (std::size_t c = 0; c < figures.size(); ++c) {
    figures[c] = {peak[c].figure(), diffuse[c].figure(), std::nullopt, std::nullopt};
    if (albedo[c].weight > 0) {
      figures[c].albedo = SpotFigure{albedo[c].sum, albedo[c].uncertainty};
    }
    if (albedo[c].sum > 0) {
      figures[c].share = SpotFigure{aside[c].sum / albedo[c].sum, aside[c].uncertainty / albedo[c].sum};
    }
  }
  return figures;
}

std::optional<SpotSpread> spread_of(std::span<const std::optional<SpotFigure>> spots) {
  if (spots.empty() || !std::ranges::all_of(spots, [](const auto& spot) { return spot.has_value(); })) {
    return std::nullopt;
  }
  const auto count = static_cast<double>(spots.size());
  SpotSpread spread;
  double variance = 0;
  for (const auto& spot : spots) {
    spread.mean += spot->value / count;
    variance += spot->uncertainty * spot->uncertainty / count;
  }
  double squares = 0;
  for (const auto& spot : spots) {
    squares += (spot->value - spread.mean) * (spot->value - spread.mean);
  }
  spread.deviation = count > 1 ? std::sqrt(squares / (count - 1)) : 0.0;
  spread.uncertainty = std::sqrt(variance);
  return spread;
}

Result<SpotGrids> combine_spots(std::span<const GridBrdf* const> spots) {
  if (spots.empty()) {
    return fail(ErrorCode::kInvalidArgument, "spots: none measured", "measure at least one");
  }
  for (const GridBrdf* spot : spots) {
    if (!same_grid(spots.front()->content(), spot->content())) {
      return fail(ErrorCode::kInvalidArgument, "spots: measured on different grids or incidences",
                  "measure all with the same instrument and settings");
    }
  }
  GridBrdf::Content mean = spots.front()->content();
  mean.metadata = {{"spots", std::to_string(spots.size())}};
  for (GridPart& part : mean.parts) {
    const auto k = static_cast<std::size_t>(&part - mean.parts.data());
    for (const GridBrdf* spot : spots) {
      const GridPart& own = spot->content().parts[k];
      for (std::size_t node = 0; node < part.origin.size(); ++node) {
        part.origin[node] = reflectance::combined(part.origin[node], own.origin[node]);
      }
    }
  }
  GridBrdf::Content deviation = mean;
  deviation.metadata["quantity"] = "standard deviation of f between spots [1/sr]";
  for (std::size_t k = 0; k < mean.parts.size(); ++k) {
    deviation.parts[k].random_per_sr.clear();
    deviation.parts[k].systematic_per_sr.clear();
    for (std::size_t c = 0; c < mean.channels; ++c) {
      for (std::size_t node = 0; node < mean.parts[k].origin.size(); ++node) {
        combine_node(spots, k, c, node, mean.parts[k], deviation.parts[k]);
      }
    }
  }
  auto mean_grid = GridBrdf::make(std::move(mean));
  if (!mean_grid) {
    return std::unexpected(mean_grid.error());
  }
  auto deviation_grid = GridBrdf::make(std::move(deviation));
  if (!deviation_grid) {
    return std::unexpected(deviation_grid.error());
  }
  return SpotGrids{std::move(*mean_grid), std::move(*deviation_grid)};
}

Measurement mean_measurement(std::span<const Measurement* const> spots, GridBrdf mean) {
  Measurement all{.brdf = std::move(mean),
                  .albedo = {},
                  .quality = {},
                  .tilt = {},
                  .ledger = {},
                  .descriptor = spots.front()->descriptor,
                  .instrument_seconds = 0,
                  .raw_bytes = 0,
                  .recording_id = {},
                  .calibration_id = spots.front()->calibration_id};
  all.albedo = measurement::measured_albedo(all.brdf);
  for (std::size_t k = 0; k < spots.size(); ++k) {
    const Measurement& spot = *spots[k];
    all.instrument_seconds += spot.instrument_seconds;
    all.raw_bytes += spot.raw_bytes;
    all.ledger.exposed += spot.ledger.exposed;
    all.ledger.delivered += spot.ledger.delivered;
    all.ledger.lost_sensor += spot.ledger.lost_sensor;
    all.ledger.lost_firmware += spot.ledger.lost_firmware;
    all.ledger.lost_link += spot.ledger.lost_link;
    all.ledger.lost_host += spot.ledger.lost_host;
    all.ledger.corrupt += spot.ledger.corrupt;
    for (measurement::QualityItem item : spot.quality) {
      if (item.verdict != measurement::Verdict::kOk) {
        item.advice = fmt::format("spot {}: {}", k + 1, item.advice);
      }
      const auto known = std::ranges::find(all.quality, item.name, &measurement::QualityItem::name);
      if (known == all.quality.end()) {
        all.quality.push_back(std::move(item));
      } else if (severity(item.verdict) > severity(known->verdict)) {
        *known = std::move(item);
      }
    }
  }
  return all;
}

}  // namespace scatter::cli
