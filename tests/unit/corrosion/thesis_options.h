// The case that tests of the thesis mode start from.
#pragma once

#include <cstddef>

#include "simulator/corrosion/growth_options.h"

namespace scatter::corrosion {

/// Even maps and 20 starting points, as the thesis's row of ages has them.
inline GrowthOptions thesis(std::size_t side, Corrosivity corrosivity, double age) {
  GrowthOptions options;
  options.mode = Mode::kThesis;
  options.side = side;
  options.corrosivity = corrosivity;
  options.age_years = age;
  options.starting_points = 20;
  return options;
}

}  // namespace scatter::corrosion
