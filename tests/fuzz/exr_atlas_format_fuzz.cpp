// The EXR atlas reader: what it accepts are consistent grids, one per name.
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <string_view>

#include "host_sdk/formats/exr_atlas.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto entries =
      scatter::formats::decode_exr_atlas({reinterpret_cast<const char*>(data), size}, "fuzz.exr");
  if (!entries) {
    if (entries.error().what.empty() || entries.error().remedy.empty()) {
      std::abort();
    }
    return 0;
  }
  if (entries->empty()) {
    std::abort();
  }
  for (const auto& entry : *entries) {
    if (!scatter::reflectance::SpecularGridBrdf::make(entry.brdf.content()).has_value() ||
        entry.brdf.channels() != entries->front().brdf.channels()) {
      std::abort();
    }
  }
  return 0;
}
