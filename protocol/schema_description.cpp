#include "protocol/schema_description.h"

#include "protocol/endian.h"

namespace scatter::protocol {
namespace {

template <typename... M>
constexpr bool every_message_fits_the_smallest_payload(std::tuple<M...>*) {
  return ((max_encoded_size<M>() <= kMaxSerialPayload) && ...);
}
static_assert(every_message_fits_the_smallest_payload(static_cast<AllMessages*>(nullptr)),
              "a message without its tail must fit any carrier, or it could not be sent on serial lines");

constexpr std::uint32_t digest() {
  std::array<std::uint32_t, 256> table{};
  for (std::uint32_t i = 0; i < 256; ++i) {
    std::uint32_t crc = i;
    for (int bit = 0; bit < 8; ++bit) {
      crc = (crc >> 1U) ^ ((crc & 1U) != 0 ? 0x82F63B78U : 0U);
    }
    table[i] = crc;
  }
  std::uint32_t crc = 0xFFFFFFFFU;
  describe_schema(
      [&](std::string_view piece) {
        for (const char c : piece) {
          crc = (crc >> 8U) ^ table[(crc ^ static_cast<std::uint8_t>(c)) & 0xFFU];
        }
      },
      Detail::kWire);
  return ~crc;
}

constexpr std::uint32_t kDigest = digest();

}  // namespace

std::uint32_t schema_digest() noexcept {
  return kDigest;
}

}  // namespace scatter::protocol
