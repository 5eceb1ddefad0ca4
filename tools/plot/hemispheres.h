// False-colour pictures of the scattering hemisphere: one disc per illumination.
#pragma once

#include <string>
#include <vector>

#include "host_sdk/error/error.h"
#include "host_sdk/reflectance/grid_brdf.h"
#include "tools/plot/canvas.h"
#include "tools/plot/ticks.h"

namespace scatter::plot {

struct HemisphereOptions {
  ImageKind kind = ImageKind::kPng;
  Theme theme = Theme::kDark;
  Scale scale = Scale::kAuto;
  bool luminance = false;               ///< One column, the mean of the channels, instead of one per channel.
  std::string title = {};               ///< Empty: none.
  std::string subtitle = {};            ///< Empty: none.
  double disc_px = 264;                 ///< Diameter of the horizon, 48..2000.
  double pixel_ratio = 1;               ///< Pixels per unit, 0.5..4; 2 for fine screens (PNG only).
  std::size_t max_rows = 12;            ///< Of more incidences, this many are shown, evenly spaced.
  std::vector<std::string> notes = {};  ///< Sentences for the caption, such as `dirac_note`.
};

/// Draws f [1/sr] of every incidence (rows) and channel (columns); with one column up to four incidences
/// stand side by side.
///
/// A disc shows the exit hemisphere from outside: the centre is the normal, the radius is proportional to
/// theta_o, the rim is the horizon, phi = 0 is on the right, phi counts counter-clockwise; circles at
/// 30, 60 and 75 deg. One scale for all discs, from the 0.2 % quantile to the largest value, over measured
/// nodes where there are any. Interpolated nodes (blind spots) are hatched one way, extrapolated ones the
/// other way, invalid ones dark grey; rings between the grid's last one and the horizon are extrapolated (or
/// invalid, as the last one is). A ring with rays marks the light, a diamond the mirror direction
/// (BTDF: the straight direction).
///
/// A caption tells what the discs cannot show: that there is no value at all, values that a logarithmic scale
/// leaves out, incidences and channels (12 of more are drawn) left out. `told` gets the same sentences.
///
/// Errors    kInvalidArgument: no incidence, or sizes outside their range.
/// Threads   thread-safe.
[[nodiscard]] Result<std::string> hemispheres(const reflectance::GridBrdf& brdf,
                                              const HemisphereOptions& options,
                                              std::vector<std::string>* told = nullptr);

}  // namespace scatter::plot
