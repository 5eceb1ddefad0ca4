// Grey and colour images in PNG files.
#pragma once

#include <string>
#include <string_view>

#include "host_sdk/images/image.h"

namespace scatter::images {

struct PngOptions {
  int bits = 8;                           ///< 8 or 16.
  Encoding encoding = Encoding::kLinear;  ///< kSrgb: values are linear here and encoded in the file.
};

/// Values are clamped to 0..1 and rounded; not-a-number becomes 0. The same image gives the same bytes.
/// Errors    kInvalidArgument: check(image), or other than 8 or 16 bits.
[[nodiscard]] Result<std::string> encode_png_image(const Image& image, const PngOptions& options = {});

/// 1 to 16 bits, grey, colour or palette, with or without transparency, interlaced or not; values 0..1. The
/// file's own gamma, chromaticities and profile are not applied: `encoding` says what the numbers are. Errors
/// kDataLoss: damaged, cut, or claims more pixels than its bytes can hold (libpng's words);
///           kResourceExhausted: more than kMostPixels.
[[nodiscard]] Result<Image> decode_png_image(std::string_view bytes, std::string_view name,
                                             Encoding encoding);

}  // namespace scatter::images
