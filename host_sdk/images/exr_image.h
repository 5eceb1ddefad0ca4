// Grey and colour images in OpenEXR files.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "host_sdk/images/image.h"

namespace scatter::images {

enum class ExrPixel : std::uint8_t {
  kHalf,   ///< 11 bits of precision, up to 65504; larger values become infinite.
  kFloat,  ///< As in memory.
};

/// A flat scan line image, ZIP: channel Y, or R, G, B, or those and A. The same image gives the same bytes.
/// Errors    kInvalidArgument: check(image).
/// Threads   as OpenEXR's pool (exr_threads.h); may be called from several.
[[nodiscard]] Result<std::string> encode_exr_image(const Image& image, ExrPixel pixel = ExrPixel::kFloat);

/// Reads half, float or integer channels R, G, B (and A), or Y, or the only channel whatever its name.
/// Values come as they stand, infinities and not-a-number included.
/// Errors    kDataLoss: damaged, cut, or claims more pixels than its bytes can hold; kInvalidArgument: other
///           channels, subsampled ones; kUnimplemented: tiled, deep; kResourceExhausted: more than
///           kMostPixels.
[[nodiscard]] Result<Image> decode_exr_image(std::string_view bytes, std::string_view name);

}  // namespace scatter::images
