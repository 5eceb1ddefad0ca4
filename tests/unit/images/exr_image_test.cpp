// PROVES: host_sdk/images/exr_image.h. The peer is OpenEXR itself.
#include "host_sdk/images/exr_image.h"

#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfInputFile.h>
#include <OpenEXR/ImfOutputFile.h>

#include <Imath/half.h>

#include <catch2/catch.hpp>
#include <cmath>
#include <cstring>
#include <limits>

#include "host_sdk/images/exr_stream.h"

using namespace scatter;
using namespace scatter::images;

namespace {

Image picture(std::size_t channels) {
  Image image{.width = 37, .height = 21, .channels = channels, .values = {}};
  for (std::size_t n = 0; n < image.pixels() * channels; ++n) {
    image.values.push_back(std::sin(static_cast<float>(n)) * std::exp(static_cast<float>(n % 19) - 9));
  }
  return image;
}

/// A file of these float channels, all of the same values, written by OpenEXR alone.
std::string peer_file(const std::vector<std::string>& names, int sampling = 1) {
  Imf::Header header(4, 2);
  std::vector<float> values = {0, 1, 2, 3, 4, 5, 6, 7};
  Imf::FrameBuffer buffer;
  for (const auto& name : names) {
    header.channels().insert(name, Imf::Channel(Imf::FLOAT, sampling, 1));
    buffer.insert(name, Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(values.data()), 4, 16, sampling, 1));
  }
  ExrMemoryOutput stream(1000);
  {
    Imf::OutputFile file(stream, header);
    file.setFrameBuffer(buffer);
    file.writePixels(2);
  }
  return stream.take();
}

}  // namespace

TEST_CASE("Float EXR keeps every bit of grey, RGB and RGBA, and the same image gives the same bytes") {
  for (const std::size_t channels : {1, 3, 4}) {
    Image image = picture(channels);
    image.values[5] = std::numeric_limits<float>::infinity();
    image.values[6] = std::numeric_limits<float>::quiet_NaN();
    const auto bytes = encode_exr_image(image);
    REQUIRE(bytes.has_value());
    CHECK(*bytes == *encode_exr_image(image));
    const auto again = decode_exr_image(*bytes, "again.exr");
    REQUIRE(again.has_value());
    CHECK(again->width == 37);
    CHECK(again->height == 21);
    CHECK(again->channels == channels);
    REQUIRE(again->values.size() == image.values.size());
    CHECK(std::memcmp(again->values.data(), image.values.data(), image.values.size() * sizeof(float)) == 0);
  }
}

TEST_CASE("Half EXR keeps 11 bits") {
  const Image image = picture(3);
  const auto again = decode_exr_image(*encode_exr_image(image, ExrPixel::kHalf), "again.exr");
  REQUIRE(again.has_value());
  for (std::size_t n = 0; n < image.values.size(); ++n) {
    // Half the spacing of half-precision numbers: 2^-12 of the value, 2^-25 near zero.
    CHECK(std::abs(again->values[n] - image.values[n]) <=
          std::max(std::ldexp(std::abs(image.values[n]), -11), std::ldexp(1.0F, -25)));
  }
}

TEST_CASE("OpenEXR finds the channels and pixels that were written, first row at the top") {
  const Image image = picture(3);
  const auto bytes = encode_exr_image(image);
  ExrMemoryInput stream(*bytes, "ours");
  Imf::InputFile file(stream);
  std::vector<float> green(image.pixels());
  Imf::FrameBuffer buffer;
  buffer.insert("G", Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(green.data()), 4, 4 * image.width));
  file.setFrameBuffer(buffer);
  file.readPixels(0, 20);
  CHECK(green[0] == image.values[1]);
  CHECK(green[20 * 37 + 36] == image.values[(20 * 37 + 36) * 3 + 1]);
}

TEST_CASE(
    "A single channel is read whatever its name; others and subsampled ones are refused with their names") {
  const auto height = decode_exr_image(peer_file({"height"}), "h.exr");
  REQUIRE(height.has_value());
  CHECK(height->channels == 1);
  CHECK(height->values == std::vector<float>{0, 1, 2, 3, 4, 5, 6, 7});
  CHECK(decode_exr_image(peer_file({"R", "G", "B", "Z"}), "rgbz.exr")->channels == 3);
  const auto strange = decode_exr_image(peer_file({"U", "V"}), "uv.exr");
  REQUIRE_FALSE(strange.has_value());
  CHECK(strange.error().what == "uv.exr: channels are U, V, expected R, G, B or Y or a single one");
  const auto coarse = decode_exr_image(peer_file({"Y"}, 2), "coarse.exr");
  REQUIRE_FALSE(coarse.has_value());
  CHECK(coarse.error().what.find("every 2 x 1 pixels") != std::string::npos);
}

TEST_CASE("An EXR image that is cut anywhere is refused, and one that claims too much takes no memory") {
  const auto bytes = encode_exr_image(picture(3), ExrPixel::kHalf);
  for (std::size_t size = 0; size < bytes->size(); size += 7) {
    INFO(size);
    const auto cut = decode_exr_image(std::string_view(*bytes).substr(0, size), "cut.exr");
    REQUIRE_FALSE(cut.has_value());
    CHECK(cut.error().what.starts_with("cut.exr: "));
    CHECK_FALSE(cut.error().remedy.empty());
  }
  std::string huge = *bytes;
  const auto at = huge.find("dataWindow");
  REQUIRE(at != std::string::npos);
  const std::int32_t most = 20000;
  std::memcpy(&huge[at + 11 + 6 + 4 + 8], &most, 4);
  std::memcpy(&huge[at + 11 + 6 + 4 + 12], &most, 4);
  const auto refused = decode_exr_image(huge, "huge.exr");
  REQUIRE_FALSE(refused.has_value());
  CHECK(refused.error().code == ErrorCode::kDataLoss);
}
