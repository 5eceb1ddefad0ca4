// A calibration's bytes, whatever they are: refused, or understood and written back the same.
#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <span>

#include "host_sdk/measurement/references.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using scatter::measurement::ReferenceSet;
  const auto set = ReferenceSet::parse(std::as_bytes(std::span(data, size)));
  if (!set) {
    if (set.error().what.empty() || set.error().remedy.empty()) {
      std::abort();
    }
    return 0;
  }
  // What was accepted keeps its meaning: written and read again it has the same content.
  const std::vector<std::byte> bytes = (*set)->serialise();
  const auto again = ReferenceSet::parse(bytes);
  if (!again || (*again)->serialise() != bytes) {
    std::abort();
  }
  return 0;
}
