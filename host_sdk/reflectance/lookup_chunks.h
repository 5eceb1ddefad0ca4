// A batch of look-ups in pieces, with what the lookup leaves over done by the scalar code.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <span>

#include "host_sdk/reflectance/grid_lookup.h"

namespace scatter::reflectance {

/// Calls look(first, f, origin) for consecutive pieces, with room for origins that nobody wants, and then
/// ask(k, f of k), which returns the origin, wherever it left kAskScalar.
template <class Look, class Ask>
void in_chunks(std::size_t count, std::size_t channels, std::span<double> f_per_sr, std::span<Origin> origin,
               const Look& look, const Ask& ask) {
  std::array<Origin, 1024> unwanted;
  for (std::size_t first = 0; first < count; first += unwanted.size()) {
    const std::size_t size = std::min(unwanted.size(), count - first);
    const std::span<Origin> from =
        origin.empty() ? std::span(unwanted).first(size) : origin.subspan(first, size);
    look(first, f_per_sr.subspan(first * channels, size * channels), from);
    for (std::size_t k = 0; k < size; ++k) {
      if (from[k] == kAskScalar) {
        from[k] = ask(first + k, f_per_sr.subspan((first + k) * channels, channels));
      }
    }
  }
}

}  // namespace scatter::reflectance
