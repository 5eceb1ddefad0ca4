// The MiniDiff reader: what it accepts is a consistent grid, the same with either kind of line
// end, and what our writer makes of it reads back.
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include "host_sdk/formats/minidiff.h"
#include "tests/fuzz/require.h"

using scatter::fuzz::require;

using namespace scatter::reflectance;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  const auto grid = scatter::formats::decode_minidiff(text, "fuzz.bsdf");
  if (!grid) {
    require(grid.error().what.starts_with("fuzz.bsdf: ") && !grid.error().remedy.empty());
    return 0;
  }
  require(GridBrdf::make(grid->content()).has_value());
  std::string crlf;
  for (const char c : text) {
    if (c == '\n') {
      crlf += '\r';
    }
    crlf += c;
  }
  const auto same = scatter::formats::decode_minidiff(crlf, "fuzz.bsdf");
  require(same.has_value() && same->content().parts.size() == grid->content().parts.size());
  for (std::size_t p = 0; p < grid->content().parts.size(); ++p) {
    require(same->content().parts[p].f_per_sr == grid->content().parts[p].f_per_sr);
  }
  // Writing takes milliseconds per block: one input in 64 is enough.
  if (size % 64 == 0 && grid->content().parts.size() * grid->channels() <= 2) {
    const auto written = scatter::formats::encode_minidiff(*grid);
    require(!written || scatter::formats::decode_minidiff(*written, "again.bsdf").has_value());
  }
  return 0;
}
