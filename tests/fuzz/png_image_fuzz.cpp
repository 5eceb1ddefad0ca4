// The PNG reader: what it accepts is a whole image of values 0..1 that survives writing.
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "host_sdk/images/png_image.h"
#include "tests/fuzz/require.h"

using scatter::fuzz::require;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace scatter::images;
  const std::string_view bytes(reinterpret_cast<const char*>(data), size);
  const auto image = decode_png_image(bytes, "fuzz.png", Encoding::kLinear);
  if (!image) {
    require(!image.error().what.empty() && !image.error().remedy.empty());
    return 0;
  }
  require(check(*image).has_value());
  for (const float value : image->values) {
    require(value >= 0 && value <= 1);
  }
  // 16 bits hold every value of 1 to 16 bits: 65535 is a multiple of 1, 3, 15 and 255.
  const auto written = encode_png_image(*image, {.bits = 16, .encoding = Encoding::kLinear});
  require(written.has_value());
  const auto again = decode_png_image(*written, "again.png", Encoding::kLinear);
  require(again.has_value() && again->width == image->width && again->channels == image->channels);
  for (std::size_t n = 0; n < image->values.size(); ++n) {
    require(again->values[n] - image->values[n] < 1e-6F && image->values[n] - again->values[n] < 1e-6F);
  }
  return 0;
}
