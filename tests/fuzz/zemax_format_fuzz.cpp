// The Zemax reader: what it accepts is a consistent grid, the same with either kind of line end, and
// what our writer makes of it reads back.
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <string>
#include <string_view>

#include "host_sdk/formats/zemax.h"

using namespace scatter::reflectance;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  const auto grid = scatter::formats::decode_zemax(text, "fuzz.bsdf");
  if (!grid && (!grid.error().what.starts_with("fuzz.bsdf: ") || grid.error().remedy.empty())) {
    std::abort();
  }
  std::string crlf;
  for (const char c : text) {
    if (c == '\n') {
      crlf += '\r';
    }
    crlf += c;
  }
  const auto same = scatter::formats::decode_zemax(crlf, "fuzz.bsdf");
  if (same.has_value() != grid.has_value()) {
    // Longer lines can only let a count pass that had too few bytes behind it, never the reverse.
    if (grid) {
      std::abort();
    }
    return 0;
  }
  if (grid && (same->content().f_per_sr != grid->content().f_per_sr ||
               same->content().radial != grid->content().radial ||
               !SpecularGridBrdf::make(grid->content()).has_value())) {
    std::abort();
  }
  // What our writer makes of it reads back, to the digits written.
  if (grid && grid->content().f_per_sr[0].size() < 4096) {
    const auto written = scatter::formats::encode_zemax(*grid, {.digits = 9, .rgb_sections = true});
    if (!written) {
      std::abort();
    }
    const auto again = scatter::formats::decode_zemax(*written, "again.bsdf");
    if (!again || again->content().theta_i.size() != grid->content().theta_i.size() ||
        again->channels() != grid->channels() ||
        (again->content().plane_symmetric == grid->content().plane_symmetric &&
         again->content().f_per_sr != grid->content().f_per_sr)) {
      std::abort();
    }
  }
  return 0;
}
