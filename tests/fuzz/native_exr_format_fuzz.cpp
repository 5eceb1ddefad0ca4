// The native EXR reader: what it accepts is a consistent grid that survives writing bit by bit.
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string_view>

#include "host_sdk/formats/native_exr.h"
#include "tests/fuzz/require.h"

using scatter::fuzz::require;

namespace {

using scatter::reflectance::GridBrdf;
using Planes = std::vector<std::vector<float>>;

bool same_bits(const Planes& a, const Planes& b) {
  if (a.size() != b.size()) {
    return false;
  }
  for (std::size_t c = 0; c < a.size(); ++c) {
    if (a[c].size() != b[c].size() ||
        std::memcmp(a[c].data(), b[c].data(), a[c].size() * sizeof(float)) != 0) {
      return false;
    }
  }
  return true;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view bytes(reinterpret_cast<const char*>(data), size);
  const auto grid = scatter::formats::decode_native_exr(bytes, "fuzz.exr");
  if (!grid) {
    require(!grid.error().what.empty() && !grid.error().remedy.empty());
    return 0;
  }
  require(GridBrdf::make(grid->content()).has_value());
  const auto written = scatter::formats::encode_native_exr(*grid);
  if (!written) {
    return 0;  // A metadata key that the reader takes and the writer does not.
  }
  const auto again = scatter::formats::decode_native_exr(*written, "again.exr");
  require(again.has_value());
  const auto& a = grid->content();
  const auto& b = again->content();
  require(a.metadata == b.metadata && a.parts.size() == b.parts.size() && a.channels == b.channels);
  for (std::size_t p = 0; p < a.parts.size(); ++p) {
    require(same_bits(a.parts[p].f_per_sr, b.parts[p].f_per_sr));
    require(same_bits(a.parts[p].random_per_sr, b.parts[p].random_per_sr));
    require(same_bits(a.parts[p].systematic_per_sr, b.parts[p].systematic_per_sr));
    require(a.parts[p].origin == b.parts[p].origin);
  }
  return 0;
}
