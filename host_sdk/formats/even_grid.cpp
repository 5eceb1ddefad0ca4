#include "host_sdk/formats/even_grid.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

namespace scatter::formats {
namespace {

using reflectance::GridPart;
using reflectance::Origin;
using Planes = std::vector<std::vector<float>>;

constexpr double kUnitsPerDegree = 1e4;
/// Radians written with six digits are off by less than this [units].
constexpr double kRounding = 0.35;
constexpr std::size_t kFewestShare = 20;
constexpr std::size_t kMostNodes = 2'000'000;

/// Largest step of which all angles (and the range, if given) are multiples [units]; 0: none.
long long step_of(std::span<const double> angles_deg, long long range) {
  long long step = range;
  for (const double angle : angles_deg) {
    const double units = angle * kUnitsPerDegree;
    if (std::abs(units - std::round(units)) > kRounding) {
      return 0;
    }
    step = std::gcd(step, std::llround(units));
  }
  return step;
}

double widest_gap(std::span<const double> angles) {
  double gap = 0;
  for (std::size_t k = 1; k < angles.size(); ++k) {
    gap = std::max(gap, angles[k] - angles[k - 1]);
  }
  return gap;
}

/// Place of an even node among the given angles.
struct Bracket {
  std::size_t below = 0;
  std::size_t above = 0;
  double share = 0;
  bool outside = false;
};

/// One per even node; periodic: beyond the last comes the first.
std::vector<Bracket> brackets(std::span<const double> given, double step, std::size_t count, double period) {
  std::vector<Bracket> out;
  std::size_t above = 0;
  for (std::size_t k = 0; k < count; ++k) {
    const double angle = static_cast<double>(k) * step;
    const double same = 0.5 / kUnitsPerDegree;
    while (above < given.size() && given[above] < angle - same) {
      ++above;
    }
    if (above < given.size() && given[above] <= angle + same) {
      out.push_back({above, above, 0, false});
    } else if (above > 0 && above < given.size()) {
      out.push_back(
          {above - 1, above, (angle - given[above - 1]) / (given[above] - given[above - 1]), false});
    } else if (period > 0) {
      const double last = above > 0 ? given.back() : given.back() - period;
      const double next = above > 0 ? given.front() + period : given.front();
      out.push_back({given.size() - 1, 0, (angle - last) / (next - last), false});
    } else {
      out.push_back({0, 0, 0, true});
    }
  }
  return out;
}

struct Corner {
  std::size_t node;
  double weight;
};

/// Value at theta 0 in all columns.
GridPart with_one_pole(GridPart part, std::size_t phi_count) {
  double valid = 0;
  Origin origin = Origin::kInvalid;
  for (std::size_t i = 0; i < phi_count; ++i) {
    valid += part.origin[i] == Origin::kInvalid ? 0 : 1;
    origin = std::max(origin, part.origin[i]);
  }
  if (valid == 0 || valid == static_cast<double>(phi_count)) {
    return part;
  }
  for (Planes* planes : {&part.f_per_sr, &part.random_per_sr, &part.systematic_per_sr}) {
    for (auto& plane : *planes) {
      double sum = 0;
      for (std::size_t i = 0; i < phi_count; ++i) {
        sum += part.origin[i] == Origin::kInvalid ? 0.0 : static_cast<double>(plane[i]);
      }
      std::fill_n(plane.begin(), phi_count, static_cast<float>(sum / valid));
    }
  }
  std::fill_n(part.origin.begin(), phi_count, origin);
  return part;
}

}  // namespace

std::optional<EvenLayout> even_layout(std::span<const double> theta_deg, std::span<const double> phi_deg,
                                      double widest_theta_deg, double widest_phi_deg) {
  constexpr auto kTurn = static_cast<long long>(360 * kUnitsPerDegree);
  const long long theta_step = step_of(theta_deg, 0);
  const long long phi_step = step_of(phi_deg, kTurn);
  if (theta_deg.empty() || phi_deg.empty() || theta_step == 0 || phi_step == 0) {
    return std::nullopt;
  }
  const double around = phi_deg.front() + 360 - phi_deg.back();
  if (widest_gap(theta_deg) > widest_theta_deg || std::max(widest_gap(phi_deg), around) > widest_phi_deg) {
    return std::nullopt;
  }
  EvenLayout layout;
  layout.theta_step_deg = static_cast<double>(theta_step) / kUnitsPerDegree;
  layout.phi_step_deg = static_cast<double>(phi_step) / kUnitsPerDegree;
  layout.theta_count =
      static_cast<std::size_t>(std::llround(theta_deg.back() * kUnitsPerDegree) / theta_step) + 1;
  layout.phi_count = static_cast<std::size_t>(kTurn / phi_step);
  const std::size_t nodes = layout.theta_count * layout.phi_count;
  if (layout.theta_count < 2 || nodes > kMostNodes ||
      nodes > kFewestShare * theta_deg.size() * phi_deg.size()) {
    return std::nullopt;
  }
  return layout;
}

GridPart on_even_grid(const GridPart& given, std::span<const double> theta_deg,
                      std::span<const double> phi_deg, const EvenLayout& layout) {
  const GridPart source = theta_deg.front() == 0 ? with_one_pole(given, phi_deg.size()) : given;
  GridPart part;
  part.rotation_rad = source.rotation_rad;
  part.theta_i = source.theta_i;
  part.phi_i = source.phi_i;
  const std::size_t nodes = layout.theta_count * layout.phi_count;
  part.origin.assign(nodes, Origin::kInvalid);
  const std::array<std::pair<const Planes*, Planes*>, 3> planes{
      {{&source.f_per_sr, &part.f_per_sr},
       {&source.random_per_sr, &part.random_per_sr},
       {&source.systematic_per_sr, &part.systematic_per_sr}}};
  for (const auto& [from, to] : planes) {
    to->assign(from->size(), std::vector<float>(nodes));
  }
  const auto rows = brackets(theta_deg, layout.theta_step_deg, layout.theta_count, 0);
  const auto columns = brackets(phi_deg, layout.phi_step_deg, layout.phi_count, 360);
  for (std::size_t n = 0; n < nodes; ++n) {
    const Bracket& row = rows[n / layout.phi_count];
    const Bracket& column = columns[n % layout.phi_count];
    if (row.outside) {
      continue;
    }
    const std::array<Corner, 4> corners{
        {{row.below * phi_deg.size() + column.below, (1 - row.share) * (1 - column.share)},
         {row.below * phi_deg.size() + column.above, (1 - row.share) * column.share},
         {row.above * phi_deg.size() + column.below, row.share * (1 - column.share)},
         {row.above * phi_deg.size() + column.above, row.share * column.share}}};
    Origin origin = row.share > 0 || (column.share > 0 && n >= layout.phi_count) ? Origin::kInterpolated
                                                                                 : Origin::kMeasured;
    for (const Corner& corner : corners) {
      origin = corner.weight > 0 ? combined(origin, source.origin[corner.node]) : origin;
    }
    part.origin[n] = origin;
    if (origin == Origin::kInvalid) {
      continue;
    }
    for (const auto& [from, to] : planes) {
      for (std::size_t c = 0; c < from->size(); ++c) {
        double sum = 0;
        for (const Corner& corner : corners) {
          sum += corner.weight > 0 ? corner.weight * static_cast<double>((*from)[c][corner.node]) : 0;
        }
        (*to)[c][n] = static_cast<float>(sum);
      }
    }
  }
  return part;
}

}  // namespace scatter::formats
