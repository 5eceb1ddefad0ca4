// In-plane cuts through one or several BRDFs, with their uncertainty.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "host_sdk/error/error.h"
#include "host_sdk/reflectance/brdf.h"
#include "tools/plot/canvas.h"
#include "tools/plot/ticks.h"

namespace scatter::plot {

struct NamedBrdf {
  std::string name;
  const reflectance::Brdf* brdf = nullptr;  ///< Not owned; not null.
};

/// Light direction of one panel [rad].
struct Incidence {
  double theta_i = 0;
  double phi_i = 0;
};

struct CurveOptions {
  ImageKind kind = ImageKind::kSvg;
  Theme theme = Theme::kLight;
  Scale scale = Scale::kAuto;
  std::string title = {};                  ///< Empty: none.
  std::vector<Incidence> incidences = {};  ///< One panel each, 1..24.
  double theta_max_deg = 75;               ///< Curves run from -theta_max to theta_max, 1..90.
  double pixel_ratio = 1;                  ///< PNG only, 0.5..4.
};

/// Incidences that a BRDF was measured at; 0, 20, 40 and 60 deg for everything else.
[[nodiscard]] std::vector<Incidence> incidences_of(const reflectance::Brdf& brdf);

/// Draws f [1/sr] in the plane of incidence over theta_o; negative theta_o lies on the light's side.
///
/// One panel per incidence, one common axis of values. Channels differ by colour, BRDFs by the kind of
/// line; the band is +-2 standard uncertainties (random and systematic combined), about 95 %. Where a
/// value is interpolated or extrapolated the line is pale; where there is none it stops. Vertical lines:
/// mirror direction (dashed; BTDF: straight through) and light (dotted).
///
/// Errors    kInvalidArgument: no BRDF, BRDF beside BTDF, numbers outside their range.
/// Threads   thread-safe.
[[nodiscard]] Result<std::string> curves(std::span<const NamedBrdf> brdfs, const CurveOptions& options);

}  // namespace scatter::plot
