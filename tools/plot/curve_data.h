// Cuts through BRDFs, their common axis, and what of them a picture cannot show.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "tools/plot/incidence.h"
#include "tools/plot/ticks.h"

namespace scatter::plot {

struct Point {
  double theta_deg = 0;
  double value = 0;
  double twice_uncertainty = 0;  ///< 0 when unknown.
  reflectance::Origin origin = reflectance::Origin::kInvalid;
};

/// One line of one panel.
struct Curve {
  std::size_t brdf = 0;
  std::size_t line = 0;  ///< Place among the channels drawn of this BRDF.
  std::vector<Point> points;
};

/// The lines of one BRDF for these channels, over -theta_max..theta_max.
[[nodiscard]] std::vector<Curve> cut(const reflectance::Brdf& brdf, std::size_t index,
                                     std::span<const std::size_t> channels, const Incidence& light,
                                     double theta_max_deg);

/// One axis for all panels. kAuto is linear where a whole line would be missing for being negative.
[[nodiscard]] Axis value_axis(const std::vector<std::vector<Curve>>& panels, Scale scale);

/// Whether the axis can show a point.
[[nodiscard]] bool shown(const Point& point, const Axis& axis);

/// Sentences about values that a logarithmic axis leaves out, with counts, and about lines without a value.
[[nodiscard]] std::vector<std::string> unseen(const std::vector<std::vector<Curve>>& panels, const Axis& axis,
                                              std::span<const NamedBrdf> brdfs,
                                              std::span<const std::vector<std::size_t>> drawn);

}  // namespace scatter::plot
