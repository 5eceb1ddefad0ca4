// PROVES: host_sdk/images/image.h, decode_image.h.
#include "host_sdk/images/image.h"

#include <catch2/catch.hpp>

#include "host_sdk/images/decode_image.h"
#include "host_sdk/images/exr_image.h"
#include "host_sdk/images/png_image.h"

using namespace scatter;
using namespace scatter::images;

TEST_CASE("The sRGB curve is that of IEC 61966-2-1, and its two sides undo each other") {
  // The standard's 8-bit code 128 is 0.2158605 of full scale; 0.5 of full scale is code 187.516.
  CHECK(srgb_to_linear(128.0F / 255) == Approx(0.2158605).epsilon(1e-5));
  CHECK(linear_to_srgb(0.5F) * 255 == Approx(187.5160).epsilon(1e-5));
  CHECK(srgb_to_linear(0) == 0);
  CHECK(srgb_to_linear(1) == Approx(1));
  CHECK(linear_to_srgb(0.001F) == Approx(0.01292));
  for (float value = 0; value <= 1; value += 0.01F) {
    CHECK(linear_to_srgb(srgb_to_linear(value)) == Approx(value).margin(2e-6));
  }
}

TEST_CASE("Luminance is BT.709's of colours, and grey as it is") {
  const Image colours{
      .width = 3, .height = 1, .channels = 4, .values = {1, 0, 0, 0.5F, 0, 1, 0, 0, 0, 0, 1, 1}};
  const Image grey = luminance(colours);
  CHECK(grey.channels == 1);
  CHECK(grey.values == std::vector<float>{0.2126F, 0.7152F, 0.0722F});
  CHECK(luminance(grey).values == grey.values);
}

TEST_CASE("Images of no, of too many and of ill-counted pixels are refused by both writers") {
  for (const Image& image :
       {Image{}, Image{.width = 2, .height = 2, .channels = 2, .values = std::vector<float>(8)},
        Image{.width = 2, .height = 2, .channels = 1, .values = std::vector<float>(3)},
        Image{.width = kLongestSide + 1, .height = 1, .channels = 1, .values = {}}}) {
    for (const auto& bytes : {encode_exr_image(image), encode_png_image(image)}) {
      REQUIRE_FALSE(bytes.has_value());
      CHECK(bytes.error().code == ErrorCode::kInvalidArgument);
      CHECK_FALSE(bytes.error().remedy.empty());
    }
  }
}

TEST_CASE("An image is known by its content, and anything else is refused by name") {
  const Image image{.width = 1, .height = 1, .channels = 1, .values = {1}};
  CHECK(decode_image(*encode_exr_image(image), "a", Encoding::kSrgb)->values == image.values);
  CHECK(decode_image(*encode_png_image(image), "a", Encoding::kSrgb)->values == image.values);
  for (const char* bytes : {"", "Dear Sir or Madam", "\x89PN"}) {
    const auto refused = decode_image(bytes, "letter.png", Encoding::kLinear);
    REQUIRE_FALSE(refused.has_value());
    CHECK(refused.error().code == ErrorCode::kInvalidArgument);
    CHECK(refused.error().what.starts_with("letter.png: "));
  }
}
