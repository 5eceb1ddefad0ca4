// Any image that is understood, by its content.
#pragma once

#include <string_view>

#include "host_sdk/images/image.h"

namespace scatter::images {

/// OpenEXR or PNG, known by the first bytes, never by the name.
/// `png_encoding` says what the numbers of a PNG are: kLinear for maps, kSrgb for colours.
/// Errors    kInvalidArgument: neither; else as decode_exr_image and decode_png_image.
[[nodiscard]] Result<Image> decode_image(std::string_view bytes, std::string_view name,
                                         Encoding png_encoding);

}  // namespace scatter::images
