// What is done to layered copper, step by step.
#pragma once

#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "host_sdk/error/error.h"
#include "simulator/corrosion/map.h"
#include "simulator/corrosion/patina/deposition.h"
#include "simulator/corrosion/patina/layer_stack.h"

namespace scatter::corrosion {

/// One operator of LayerStack and how much of it. Members that an operator does not name are not used.
struct ScriptStep {
  enum class Operator : std::uint8_t { kCoat, kErode, kFill, kPolish, kOffset };
  Operator operation = Operator::kCoat;
  PatinaMaterial material = PatinaMaterial::kTarnish;  ///< kCoat, kFill, kOffset.
  Map rate{1, 1, {0.0F}};                              ///< kCoat, kErode [um / year], 0..1000.
  double years = 0;                                    ///< kCoat, kErode, 0..1000.
  Deposition deposition = Deposition::kSteady;         ///< kCoat: how the map grows.
  double particle_um = 1;                              ///< kCoat by particles, 0.01..20.
  double level_um = 0;  ///< kFill, kPolish: height; kOffset: radius of the ball.
};

/// Does the steps in order. A coat by particles has the rate's mean thickness, to one particle, and falls by
/// rate. Errors  kInvalidArgument names the step (from 1), the parameter and its range; the stack then is as
/// the steps
///         before left it.
[[nodiscard]] Status apply(LayerStack& stack, std::span<const ScriptStep> steps, std::uint64_t seed);

/// Steps from text: semicolons between steps, commas between the parts of one.
///
///   coat:MATERIAL,rate=UM_PER_YEAR,years=N[,deposition=steady|random|relaxed|ballistic][,particle=UM]
///   erode:rate=UM_PER_YEAR,years=N   fill:MATERIAL,level=UM   polish:level=UM   offset:MATERIAL,radius=UM
///
/// Errors  kInvalidArgument: what was found in which step, and what is expected.
[[nodiscard]] Result<std::vector<ScriptStep>> script_from(std::string_view text);

}  // namespace scatter::corrosion
