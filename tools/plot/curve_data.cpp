#include "tools/plot/curve_data.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "tools/plot/line_style.h"

namespace scatter::plot {
namespace {

using reflectance::Brdf;
using reflectance::Direction;
using reflectance::kPi;
using reflectance::Origin;
using reflectance::radians;
using reflectance::ScatterType;

constexpr double kStepDeg = 0.5;

/// What one line holds in all panels together.
struct Tally {
  std::size_t points = 0;        ///< With a value.
  std::size_t not_positive = 0;  ///< Of these.
  std::size_t below = 0;         ///< Positive, and under the axis.
  double smallest = std::numeric_limits<double>::infinity();
};

/// By BRDF and line.
std::map<std::pair<std::size_t, std::size_t>, Tally> tallies(const std::vector<std::vector<Curve>>& panels,
                                                             const Axis& axis) {
  std::map<std::pair<std::size_t, std::size_t>, Tally> result;
  for (const auto& panel : panels) {
    for (const Curve& curve : panel) {
      Tally& tally = result[{curve.brdf, curve.line}];
      for (const Point& point : curve.points) {
        if (point.origin != Origin::kInvalid) {
          ++tally.points;
          tally.not_positive += point.value <= 0;
          tally.below += point.value > 0 && !shown(point, axis);
          tally.smallest = std::min(tally.smallest, point.value);
        }
      }
    }
  }
  return result;
}

}  // namespace

std::vector<Curve> cut(const Brdf& brdf, std::size_t index, std::span<const std::size_t> channels,
                       const Incidence& light, double theta_max_deg) {
  std::vector<Curve> lines(channels.size());
  std::vector<double> value(brdf.channels());
  std::vector<double> random(brdf.channels());
  std::vector<double> systematic(brdf.channels());
  const Direction omega_i = reflectance::from_spherical(light.theta_i, light.phi_i);
  const int steps = int(std::lround(theta_max_deg / kStepDeg));
  for (int k = -steps; k <= steps; ++k) {
    const double theta_deg = k * kStepDeg;
    Direction omega_o =
        reflectance::from_spherical(radians(std::abs(theta_deg)), light.phi_i + (theta_deg < 0 ? 0 : kPi));
    if (brdf.type() == ScatterType::kBtdf) {
      omega_o.z = -omega_o.z;
    }
    const Origin origin = brdf.eval(omega_i, omega_o, value);
    const bool known = brdf.uncertainty(omega_i, omega_o, random, systematic);
    for (std::size_t n = 0; n < channels.size(); ++n) {
      const std::size_t c = channels[n];
      const double u = known ? std::hypot(random[c], systematic[c]) : 0;
      const bool usable = std::isfinite(value[c]) && origin != Origin::kInvalid;
      lines[n].points.push_back({theta_deg, usable ? value[c] : 0, std::isfinite(u) ? 2 * u : 0,
                                 usable ? origin : Origin::kInvalid});
    }
  }
  for (std::size_t n = 0; n < channels.size(); ++n) {
    lines[n].brdf = index;
    lines[n].line = n;
  }
  return lines;
}

Axis value_axis(const std::vector<std::vector<Curve>>& panels, Scale scale) {
  double smallest = std::numeric_limits<double>::infinity();
  double largest = -smallest;
  double smallest_positive = smallest;
  std::size_t points = 0;
  std::size_t not_positive = 0;
  for (const auto& panel : panels) {
    for (const Curve& curve : panel) {
      for (const Point& point : curve.points) {
        if (point.origin != Origin::kInvalid) {
          smallest = std::min(smallest, point.value);
          largest = std::max(largest, point.value + point.twice_uncertainty);
          ++points;
          not_positive += point.value <= 0;
          smallest_positive = point.value > 0 ? std::min(smallest_positive, point.value) : smallest_positive;
        }
      }
    }
  }
  // A line of negative values is wrong data, which the picture is there to show; 1e-3 of the peak tells it
  // from noise about 0.
  const bool hides_a_line = std::ranges::any_of(tallies(panels, {}), [&](const auto& line) {
    const Tally& tally = line.second;
    return tally.points > 0 && tally.not_positive == tally.points && tally.smallest < -1e-3 * largest;
  });
  if (scale == Scale::kAuto && hides_a_line) {
    scale = Scale::kLinear;
  }
  // Data cut off at 0 (colours outside the primaries' gamut, dark bins) are no reason to hide the decades of
  // the rest.
  if (scale == Scale::kAuto && 4 * not_positive < points) {
    smallest = smallest_positive;
  }
  Axis axis = choose_axis(smallest, largest, scale);
  if (axis.log) {  // room above the peak
    axis.high *= std::pow(axis.high / axis.low, 0.06);
    axis.low /= std::pow(axis.high / axis.low, 0.04);
  }
  return axis;
}

bool shown(const Point& point, const Axis& axis) {
  return point.origin != Origin::kInvalid && (!axis.log || point.value >= axis.low);
}

std::vector<std::string> unseen(const std::vector<std::vector<Curve>>& panels, const Axis& axis,
                                std::span<const NamedBrdf> brdfs,
                                std::span<const std::vector<std::size_t>> drawn) {
  std::string not_positive;
  std::string below;
  std::string empty;
  for (const auto& [place, tally] : tallies(panels, axis)) {
    const auto name = line_name(brdfs[place.first], drawn[place.first][place.second], brdfs.size() > 1);
    const auto add = [&](std::string& list, const std::string& words) {
      list += (list.empty() ? "" : ", ") + words;
    };
    if (tally.points == 0) {
      add(empty, name);
    } else if (axis.log) {
      if (tally.not_positive > 0) {
        add(not_positive, fmt::format("{} {} of {} points", name, tally.not_positive, tally.points));
      }
      if (tally.below > 0) {
        add(below, fmt::format("{} {} of {} points", name, tally.below, tally.points));
      }
    }
  }
  std::vector<std::string> sentences;
  if (!not_positive.empty()) {
    sentences.push_back("a logarithmic scale cannot show values at or below 0: " + not_positive +
                        "; a linear scale shows them");
  }
  if (!below.empty()) {
    sentences.push_back(fmt::format("under the axis, smaller than {}: {}", short_number(axis.low), below));
  }
  if (!empty.empty()) {
    sentences.push_back("nothing to draw, no value in the plane of incidence: " + empty);
  }
  return sentences;
}

}  // namespace scatter::plot
