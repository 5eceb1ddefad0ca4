// Any bytes as the payload of every message and object. Promises: decode either refuses or gives a
// message whose encoding is canonical (encode, decode, encode gives the same bytes), within the stated
// bounds, and that keeps what was sent: the encoding begins with the payload or the payload with it.
#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "protocol/descriptor.h"
#include "protocol/message_traits.h"
#include "tests/fuzz/require.h"

using scatter::fuzz::require;

using namespace scatter::protocol;

namespace {

template <Message M>
std::vector<std::byte> encoded(const M& message) {
  std::vector<std::byte> bytes(encoded_size(message));
  require(encode(message, bytes) == bytes.size());
  return bytes;
}

template <Message M>
void check(std::span<const std::byte> payload) {
  const auto message = decode<M>(payload);
  if (!message) {
    return;
  }
  const auto first = encoded(*message);
  require(first.size() >= min_encoded_size<M>());
  require(has_tail<M>() || first.size() <= max_encoded_size<M>());
  const std::size_t common = std::min(first.size(), payload.size());
  require(std::equal(first.begin(), first.begin() + static_cast<std::ptrdiff_t>(common), payload.begin()));
  const auto again = decode<M>(first);
  require(again.has_value());
  require(encoded(*again) == first);
  if (!first.empty()) {
    std::vector<std::byte> small(first.size() - 1);
    require(!encode(*message, small));
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto payload = std::as_bytes(std::span(data, size));
  for_each_message([&]<typename M>() { check<M>(payload); });
  check<Descriptor>(payload);
  return 0;
}
