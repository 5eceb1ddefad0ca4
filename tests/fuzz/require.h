// What a fuzz target holds its reader to.
#pragma once

#include <cstdlib>

namespace scatter::fuzz {

/// Stops the program where a promise is broken, which is what a fuzzer looks for.
inline void require(bool holds) {
  if (!holds) {
    std::abort();
  }
}

}  // namespace scatter::fuzz
