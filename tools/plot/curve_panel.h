// One panel of a picture of curves.
#pragma once

#include <span>
#include <vector>

#include "tools/plot/canvas.h"
#include "tools/plot/curve_data.h"
#include "tools/plot/line_style.h"

namespace scatter::plot {

struct Box {
  double x = 0;
  double y = 0;
  double width = 0;
  double height = 0;
};

struct PanelContent {
  std::span<const Curve> lines;
  std::span<const std::vector<LineStyle>> styles;  ///< [brdf][line]
  Incidence light;
  std::string name;
  reflectance::ScatterType type = reflectance::ScatterType::kBrdf;
  bool dirac = false;  ///< A share of the light leaves in one direction alone.
};

void draw_panel(const Canvas& canvas, const Box& box, const Axis& axis, double theta_max_deg, Theme theme,
                const PanelContent& content);

}  // namespace scatter::plot
