// The benchmarks that registered themselves, in no particular order.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "tests/bench/bench.h"

namespace scatter::bench {

struct Entry {
  std::string name;
  std::function<std::vector<Figure>()> run;
};

[[nodiscard]] std::vector<Entry>& registry();

}  // namespace scatter::bench
