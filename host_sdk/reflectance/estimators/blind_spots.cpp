#include "host_sdk/reflectance/estimators/blind_spots.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "host_sdk/reflectance/estimators/hole.h"

namespace scatter::reflectance {
namespace {

/// What the exchanged directions say about one part.
struct Reversed {
  std::vector<double> f;  ///< [node * channels + channel]
  std::vector<double> sigma;
  std::vector<Origin> origin;  ///< Empty: nothing wanted or known.
  bool has_sigma = true;
};

Reversed reversed_values(const GridBrdf& grid, std::size_t p, const Brdf* reverse,
                         const std::vector<bool>& is_missing) {
  Reversed out;
  if (reverse == nullptr) {
    return out;
  }
  const std::size_t channels = grid.channels();
  const std::size_t nodes = is_missing.size();
  out.f.assign(nodes * channels, 0);
  out.sigma.assign(nodes * channels, 0);
  out.origin.assign(nodes, Origin::kInvalid);
  const Direction omega_i = grid.omega_i(p);
  std::vector<double> random(channels);
  std::vector<double> systematic(channels);
  for (std::size_t n = 0; n < nodes; ++n) {
    if (!is_missing[n]) {
      continue;
    }
    const Direction from = grid.omega_o(n);
    out.origin[n] = reverse->eval(from, omega_i, std::span(out.f).subspan(n * channels, channels));
    if (out.origin[n] != Origin::kMeasured && out.origin[n] != Origin::kInterpolated) {
      out.origin[n] = Origin::kInvalid;
      continue;
    }
    out.has_sigma = out.has_sigma && reverse->uncertainty(from, omega_i, random, systematic);
    for (std::size_t c = 0; c < channels && out.has_sigma; ++c) {
      out.sigma[n * channels + c] = std::hypot(random[c], systematic[c]);
    }
  }
  return out;
}

/// All columns of the pole count as missing when they hold no value at all.
std::vector<bool> missing_nodes(const GridPart& part, std::size_t phi_count) {
  std::vector<bool> is_missing(part.origin.size());
  for (std::size_t n = 0; n < part.origin.size(); ++n) {
    is_missing[n] = part.origin[n] == Origin::kInvalid;
  }
  const bool pole_known =
      std::find(is_missing.begin(), is_missing.begin() + static_cast<std::ptrdiff_t>(phi_count), false) !=
      is_missing.begin() + static_cast<std::ptrdiff_t>(phi_count);
  if (pole_known) {
    std::fill_n(is_missing.begin(), phi_count, false);
  }
  return is_missing;
}

/// Columns of a pole that is known in some column take the mean of those.
void complete_pole(GridPart& part, std::size_t phi_count) {
  std::size_t known = 0;
  Origin worst = Origin::kMeasured;
  for (std::size_t i = 0; i < phi_count; ++i) {
    if (part.origin[i] != Origin::kInvalid) {
      known += 1;
      worst = combined(worst, part.origin[i]);
    }
  }
  if (known == 0 || known == phi_count) {
    return;
  }
  const auto complete = [&](std::vector<std::vector<float>>& planes) {
    for (std::vector<float>& plane : planes) {
      double total = 0;
      for (std::size_t i = 0; i < phi_count; ++i) {
        total += part.origin[i] == Origin::kInvalid ? 0.0 : static_cast<double>(plane[i]);
      }
      for (std::size_t i = 0; i < phi_count; ++i) {
        plane[i] = part.origin[i] == Origin::kInvalid ? static_cast<float>(total / static_cast<double>(known))
                                                      : plane[i];
      }
    }
  };
  complete(part.f_per_sr);
  complete(part.random_per_sr);
  complete(part.systematic_per_sr);
  std::fill_n(part.origin.begin(), phi_count, worst);
}

/// Fills one hole of a part.
class Filler {
 public:
  Filler(const GridBrdf::Content& content, GridPart& part, const Reversed& reversed)
      : content_(content), part_(part), reversed_(reversed) {}

  void fill(const Hole& hole) {
    const Origin origin = hole.reaches_last_row ? Origin::kExtrapolated : Origin::kInterpolated;
    for (std::size_t c = 0; c < content_.channels; ++c) {
      fill_channel(hole, c);
    }
    for (const std::uint32_t node : hole.unknown) {
      const bool exchanged = by_reciprocity(node);
      const std::size_t count = node == 0 ? content_.phi_count : 1;
      std::fill_n(part_.origin.begin() + node, count, exchanged ? Origin::kInterpolated : origin);
      (exchanged ? reciprocity_ : neighbors_) += count;
      if (!part_.pixels.empty()) {
        std::fill_n(part_.pixels.begin() + node, count, 0.0F);
      }
    }
  }
  [[nodiscard]] std::size_t reciprocity() const noexcept { return reciprocity_; }
  [[nodiscard]] std::size_t neighbors() const noexcept { return neighbors_; }

 private:
  [[nodiscard]] bool by_reciprocity(std::uint32_t node) const {
    return !reversed_.origin.empty() && reversed_.origin[node] != Origin::kInvalid;
  }

  void fill_channel(const Hole& hole, std::size_t channel) {
    std::vector<float>& plane = part_.f_per_sr[channel];
    const auto [lowest, highest] = range(plane, hole);
    fill_hole(content_, hole, plane);
    const bool knows = !part_.random_per_sr.empty() && !part_.systematic_per_sr.empty();
    const double random = knows ? range(part_.random_per_sr[channel], hole).second : 0;
    const double systematic = knows ? range(part_.systematic_per_sr[channel], hole).second : 0;
    // Standard deviation of a uniform distribution.
    const double spread = (highest - lowest) / std::sqrt(12.0);
    for (const std::uint32_t node : hole.unknown) {
      double grown = std::hypot(systematic, spread);
      double noise = random;
      if (by_reciprocity(node)) {
        const std::size_t at = node * content_.channels + channel;
        const double distance = std::abs(reversed_.f[at] - static_cast<double>(plane[node]));
        grown = std::hypot(reversed_.has_sigma ? reversed_.sigma[at] : systematic, distance / 2);
        noise = reversed_.has_sigma ? 0 : random;
        put(plane, node, reversed_.f[at]);
      }
      if (knows) {
        put(part_.random_per_sr[channel], node, noise);
        put(part_.systematic_per_sr[channel], node, grown);
      }
    }
  }

  void put(std::vector<float>& plane, std::uint32_t node, double value) const {
    std::fill_n(plane.begin() + node, node == 0 ? content_.phi_count : 1, static_cast<float>(value));
  }

  static std::pair<double, double> range(const std::vector<float>& plane, const Hole& hole) {
    double lowest = std::numeric_limits<double>::infinity();
    double highest = -lowest;
    for (const std::uint32_t node : hole.rim) {
      lowest = std::min(lowest, static_cast<double>(plane[node]));
      highest = std::max(highest, static_cast<double>(plane[node]));
    }
    return {lowest, highest};
  }

  const GridBrdf::Content& content_;
  GridPart& part_;
  const Reversed& reversed_;
  std::size_t reciprocity_ = 0;
  std::size_t neighbors_ = 0;
};

}  // namespace

Result<FilledGrid> fill_blind_spots(const GridBrdf& grid, const Brdf* reverse) {
  if (reverse != nullptr && (grid.type() != ScatterType::kBrdf || reverse->type() != ScatterType::kBrdf ||
                             reverse->channels() != grid.channels())) {
    return fail(ErrorCode::kInvalidArgument,
                "blind spots: reciprocity needs a BRDF and an estimator with the same channels",
                "fill transmission from its neighbours only");
  }
  GridBrdf::Content content = grid.content();
  std::size_t by_reciprocity = 0;
  std::size_t by_neighbors = 0;
  std::size_t left = 0;
  for (std::size_t p = 0; p < content.parts.size(); ++p) {
    GridPart& part = content.parts[p];
    complete_pole(part, content.phi_count);
    const std::vector<bool> is_missing = missing_nodes(part, content.phi_count);
    const Reversed reversed = reversed_values(grid, p, reverse, is_missing);
    Filler filler(content, part, reversed);
    for (const Hole& hole : find_holes(content, is_missing)) {
      if (hole.rim.empty()) {
        left += hole.unknown.size();
        continue;
      }
      filler.fill(hole);
    }
    by_reciprocity += filler.reciprocity();
    by_neighbors += filler.neighbors();
  }
  content.metadata["blind_spots"] =
      fmt::format("{} nodes filled from their neighbours, {} by reciprocity", by_neighbors, by_reciprocity);
  Result<GridBrdf> made = GridBrdf::make(std::move(content));
  if (!made) {
    return std::unexpected(made.error());
  }
  return FilledGrid{std::move(*made), by_reciprocity, by_neighbors, left};
}

}  // namespace scatter::reflectance
