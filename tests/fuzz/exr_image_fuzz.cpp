// The OpenEXR image reader: what it accepts is a whole image that survives writing bit by bit.
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string_view>

#include "host_sdk/images/exr_image.h"
#include "tests/fuzz/require.h"

using scatter::fuzz::require;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace scatter::images;
  const std::string_view bytes(reinterpret_cast<const char*>(data), size);
  const auto image = decode_exr_image(bytes, "fuzz.exr");
  if (!image) {
    require(!image.error().what.empty() && !image.error().remedy.empty());
    return 0;
  }
  require(check(*image).has_value());
  const auto written = encode_exr_image(*image);
  require(written.has_value());
  const auto again = decode_exr_image(*written, "again.exr");
  require(again.has_value() && again->width == image->width && again->channels == image->channels);
  require(again->values.size() == image->values.size() &&
          std::memcmp(again->values.data(), image->values.data(), image->values.size() * sizeof(float)) == 0);
  return 0;
}
