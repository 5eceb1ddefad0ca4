// PROVES: host_sdk/images/png_image.h. The files in tests/fuzz/seeds/png_image were made by a few lines of
// Python and zlib after the PNG specification, not by libpng; their pixels are the formulas below.
#include "host_sdk/images/png_image.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <fstream>
#include <iterator>
#include <limits>

using namespace scatter;
using namespace scatter::images;

namespace {

std::string seed(const std::string& name) {
  std::ifstream file("tests/fuzz/seeds/png_image/" + name, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

Image decoded(const std::string& name, Encoding encoding = Encoding::kLinear) {
  auto image = decode_png_image(seed(name), name, encoding);
  REQUIRE(image.has_value());
  return *std::move(image);
}

/// Of the PNG specification, annex D.
std::uint32_t crc(std::string_view bytes) {
  std::uint32_t value = 0xFFFFFFFFU;
  for (const char byte : bytes) {
    value ^= static_cast<unsigned char>(byte);
    for (int bit = 0; bit < 8; ++bit) {
      value = (value & 1U) != 0 ? 0xEDB88320U ^ (value >> 1U) : value >> 1U;
    }
  }
  return ~value;
}

}  // namespace

TEST_CASE(
    "Grey PNG of 1, 8 and 16 bits, with alpha and interlaced, gives the stored numbers over full scale") {
  const Image grey = decoded("grey8.png");
  CHECK(grey.width == 3);
  CHECK(grey.height == 2);
  CHECK(grey.channels == 1);
  for (std::size_t y = 0; y < 2; ++y) {
    for (std::size_t x = 0; x < 3; ++x) {
      CHECK(grey.values[y * 3 + x] == static_cast<float>(40 * y + 10 * x) / 255);
    }
  }
  CHECK(decoded("grey1.png").values == std::vector<float>{1, 0, 0, 0, 1, 0, 0, 0, 1});
  const Image alpha = decoded("grey_alpha8.png");
  CHECK(alpha.channels == 1);
  CHECK(alpha.values == std::vector<float>{10.0F / 255, 30.0F / 255});
  const Image interlaced = decoded("interlaced.png");
  REQUIRE(interlaced.values.size() == 64);
  for (std::size_t n = 0; n < 64; ++n) {
    CHECK(interlaced.values[n] == static_cast<float>(n) / 255);
  }
}

TEST_CASE(
    "Colour PNG of 8 and 16 bits, from a palette, with alpha: colours by the encoding asked for, alpha "
    "never") {
  const Image deep = decoded("rgb16.png");
  CHECK(deep.channels == 3);
  CHECK(deep.values == std::vector<float>{0, 0, 1, 1000.0F / 65535, 0, 1, 0, 2000.0F / 65535, 1,
                                          1000.0F / 65535, 2000.0F / 65535, 1});
  const Image palette = decoded("palette.png");
  CHECK(palette.channels == 4);
  CHECK(palette.values == std::vector<float>{1, 0, 0, 51.0F / 255, 0, 128.0F / 255, 1, 1});
  const Image screen = decoded("rgba8.png", Encoding::kSrgb);  // has a gAMA of 1, which does not matter
  CHECK(screen.values[1] == Approx(0.2158605).epsilon(1e-5));
  CHECK(screen.values[3] == 64.0F / 255);
}

TEST_CASE(
    "What is written in 8 and 16 bits is read again to half a step, clamped to 0..1, byte for byte the "
    "same") {
  Image image{.width = 5, .height = 3, .channels = 3, .values = {}};
  for (std::size_t n = 0; n < 45; ++n) {
    image.values.push_back(static_cast<float>(n) / 44);
  }
  for (const int bits : {8, 16}) {
    for (const Encoding encoding : {Encoding::kLinear, Encoding::kSrgb}) {
      const auto bytes = encode_png_image(image, {.bits = bits, .encoding = encoding});
      REQUIRE(bytes.has_value());
      CHECK(*bytes == *encode_png_image(image, {.bits = bits, .encoding = encoding}));
      const auto again = decode_png_image(*bytes, "again.png", encoding);
      REQUIRE(again.has_value());
      for (std::size_t n = 0; n < 45; ++n) {
        // Half a step of the code; the sRGB curve's steepest slope towards linear is 2.28.
        const double step = (encoding == Encoding::kSrgb ? 2.28 : 1.0) / (bits == 8 ? 255 : 65535);
        CHECK(std::abs(again->values[n] - image.values[n]) <= 0.5 * step + 1e-6);
      }
    }
  }
  const Image wild{
      .width = 4,
      .height = 1,
      .channels = 1,
      .values = {-1, 7, std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()}};
  CHECK(decode_png_image(*encode_png_image(wild), "wild.png", Encoding::kLinear)->values ==
        std::vector<float>{0, 1, 0, 1});
  CHECK_FALSE(encode_png_image(image, {.bits = 12}).has_value());
}

TEST_CASE("A PNG that is cut anywhere, or has one flipped bit in its pixels, is refused with its name") {
  for (const char* name : {"grey8.png", "rgb16.png", "palette.png", "interlaced.png"}) {
    const std::string whole = seed(name);
    // The last 12 bytes are the end mark; without it the pixels are all there and the file is not.
    for (std::size_t size = 0; size < whole.size(); ++size) {
      const auto cut =
          decode_png_image(std::string_view(whole).substr(0, size), "cut.png", Encoding::kLinear);
      REQUIRE_FALSE(cut.has_value());
      CHECK(cut.error().code == ErrorCode::kDataLoss);
      CHECK(cut.error().what.starts_with("cut.png: "));
    }
    std::string flipped = whole;
    flipped[flipped.find("IDAT") + 8] ^= 4;
    CHECK_FALSE(decode_png_image(flipped, "flipped.png", Encoding::kLinear).has_value());
  }
}

TEST_CASE("A PNG that claims more pixels than its bytes can hold takes no memory") {
  std::string huge = seed("grey8.png");
  for (const std::size_t at : {16, 20}) {  // width and height in IHDR, 10000 = 0x2710
    huge[at + 2] = 0x27;
    huge[at + 3] = 0x10;
  }
  const std::uint32_t sum = crc(std::string_view(huge).substr(12, 17));
  for (std::size_t k = 0; k < 4; ++k) {
    huge[29 + k] = static_cast<char>(sum >> (24 - 8 * k));
  }
  const auto refused = decode_png_image(huge, "huge.png", Encoding::kLinear);
  REQUIRE_FALSE(refused.has_value());
  CHECK(refused.error().code == ErrorCode::kDataLoss);
  CHECK(refused.error().what == "huge.png: claims 10000 x 10000 pixels, more than its 73 bytes hold");
}
