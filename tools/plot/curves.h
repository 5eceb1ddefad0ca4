// In-plane cuts through one or several BRDFs, with their uncertainty.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "host_sdk/error/error.h"
#include "tools/plot/canvas.h"
#include "tools/plot/incidence.h"
#include "tools/plot/ticks.h"

namespace scatter::plot {

struct CurveOptions {
  ImageKind kind = ImageKind::kSvg;
  Theme theme = Theme::kLight;
  Scale scale = Scale::kAuto;
  std::string title = {};                  ///< Empty: none.
  std::vector<Incidence> incidences = {};  ///< One panel each, at least one.
  std::size_t max_panels = 24;             ///< Of more incidences, so many evenly spaced ones; 1..24.
  double theta_max_deg = 75;               ///< Curves run from -theta_max to theta_max, 1..90.
  double pixel_ratio = 1;                  ///< PNG only, 0.5..4.
};

/// Draws f [1/sr] in the plane of incidence over theta_o; negative theta_o lies on the light's side.
///
/// One panel per incidence, one common axis of values. Channels differ by colour (12 of more are drawn),
/// BRDFs by the kind of line; the band is +-2 standard uncertainties (random and systematic combined), about
/// 95 %. Where a value is interpolated or extrapolated the line is pale; where there is none it stops.
/// Vertical lines: mirror direction (dashed; BTDF: straight through) and light (dotted).
///
/// A caption tells what the curves cannot show: a Dirac share, values that a logarithmic scale leaves out,
/// BRDFs without a value, incidences and channels that were not drawn. `told` gets the same sentences.
///
/// Errors    kInvalidArgument: no BRDF, BRDF beside BTDF, numbers outside their range.
/// Threads   thread-safe.
[[nodiscard]] Result<std::string> curves(std::span<const NamedBrdf> brdfs, const CurveOptions& options,
                                         std::vector<std::string>* told = nullptr);

}  // namespace scatter::plot
