// Any bytes as the descriptors of a USB device. Promises: what is read lies in the bytes; cutting bytes off a
// whole answer never gives another whole answer with more in it; no byte behind the configuration matters.
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "host_sdk/device/usb/usb_shape.h"
#include "tests/fuzz/require.h"

using scatter::device::usb::read_shape;
using scatter::fuzz::require;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::span bytes(reinterpret_cast<const std::byte*>(data), size);
  const auto shape = read_shape(bytes);
  if (!shape) {
    return 0;
  }
  std::size_t least = 18 + 9;
  for (const auto& one : shape->interfaces) {
    least += 9 + 7 * one.endpoints.size();
  }
  require(least <= size);
  std::vector<std::byte> longer(bytes.begin(), bytes.end());
  longer.insert(longer.end(), {std::byte{9}, std::byte{4}});
  const auto same = read_shape(longer);
  require(same && same->interfaces.size() == shape->interfaces.size() && same->streams() == shape->streams());
  const auto shorter = read_shape(bytes.first(size - 1));
  require(!shorter || shorter->interfaces.size() == shape->interfaces.size());
  return 0;
}
