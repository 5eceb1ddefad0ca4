// Any bytes as a factory set, and composed sets with any objects and any flipped bytes. Promises: a set that
// is called whole has spans inside the memory, composes to the same bytes again, and its maps fit its
// descriptor; whatever else it is, it comes with a reason and without spans.
#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "firmware/core/factory_set.h"
#include "protocol/codec.h"
#include "protocol/endian.h"
#include "tests/fuzz/require.h"

using scatter::fuzz::require;
using namespace scatter::firmware;
using namespace scatter::protocol;

namespace {

using Bytes = std::span<const std::byte>;

bool inside(Bytes part, Bytes memory) {
  return part.empty() ||
         (part.data() >= memory.data() && part.data() + part.size() <= memory.data() + memory.size());
}

FactoryVerdict check(Bytes memory) {
  Descriptor descriptor;
  const FactorySet set = read_factory_set(memory, descriptor);
  const FactoryObjects& objects = set.objects;
  if (set.verdict != FactoryVerdict::kWhole) {
    require(!set.why.empty());
    require(objects.descriptor.empty() && objects.hot_pixels.empty() && objects.prnu_map.empty());
    return set.verdict;
  }
  require(set.why.empty());
  require(inside(objects.descriptor, memory) && inside(objects.hot_pixels, memory) &&
          inside(objects.prnu_map, memory));
  const std::size_t pixels = std::size_t{descriptor.sensor.width_px} * descriptor.sensor.height_px;
  require(objects.prnu_map.empty() || objects.prnu_map.size() == pixels);
  for (std::size_t at = 0; at < objects.hot_pixels.size(); at += 4) {
    require(load_le<std::uint32_t>(objects.hot_pixels.data() + at) < pixels);
  }
  return set.verdict;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const Bytes input = std::as_bytes(std::span(data, size));
  check(input);
  if (size < 4) {
    return 0;
  }
  Descriptor descriptor;
  descriptor.product = "HS-1";
  descriptor.serial = "F-1";
  descriptor.sensor.width_px = data[0] % 16;
  descriptor.sensor.height_px = data[1] % 16;
  std::vector<std::byte> encoded(encoded_size(descriptor));
  require(encode(descriptor, encoded) == encoded.size());
  const Bytes rest = input.subspan(4);
  const std::size_t prnu = std::min<std::size_t>(rest.size(), std::size_t{data[0] % 16U} * (data[1] % 16U));
  const FactoryObjects objects{
      .descriptor = encoded, .hot_pixels = rest.subspan(prnu), .prnu_map = rest.first(prnu)};
  std::vector<std::byte> set(factory_set_bytes(objects));
  require(compose_factory_set(objects, set) == set.size());
  const FactoryVerdict verdict = check(set);
  require(verdict == FactoryVerdict::kWhole || verdict == FactoryVerdict::kDamaged);
  // Any one flipped byte makes it anything but whole.
  const std::size_t at = (data[2] | std::size_t{data[3]} << 8U) % set.size();
  set[at] ^= static_cast<std::byte>(data[2] | 1U);
  require(check(set) != FactoryVerdict::kWhole);
  return 0;
}
