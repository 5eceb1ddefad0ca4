// Every power cut of a scenario, one after the other, on all processors.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "tests/power_cuts/scenario.h"

namespace scatter::power_cuts {

using Cuts = std::vector<simulator::PowerCut>;

/// "op,kind,detail[:op,kind,detail]", as replay lines end.
[[nodiscard]] std::string text_of(const Cuts& cuts);
/// False: not such a text.
[[nodiscard]] bool parse_cuts(std::string_view text, Cuts& cuts);

struct Failure {
  std::string replay;  ///< "SCENARIO:CUTS".
  std::string promise;
};

struct Outcome {
  std::uint64_t single_points = 0;
  std::uint64_t double_points = 0;
  std::uint64_t failed = 0;
  std::vector<Failure> failures{};  ///< The first few, in the order of the points.
};

/// One point; "" when every promise was kept.
[[nodiscard]] std::string try_point(const Scenario& scenario, const Cuts& cuts);

/// All points of the scenario. The outcome does not depend on the number of threads.
[[nodiscard]] Outcome enumerate(const Scenario& scenario, bool quick, unsigned threads);

}  // namespace scatter::power_cuts
