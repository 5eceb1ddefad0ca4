// Sizes in an OpenEXR header held against the file, before OpenEXR allocates what they claim.
// For images and formats.
#pragma once

#include <string_view>

#include "host_sdk/error/error.h"

namespace scatter::images {

/// Walks the attributes of all parts.
/// Errors  kDataLoss: byte offset, expected, found: an attribute longer than the rest of the
///         file, an image of more pixels or chunks than the file can hold;
///         kUnimplemented: tiled or deep images.
/// Source  OpenEXR file layout: magic, version, headers (name, type, size, value).
[[nodiscard]] Status check_exr_header(std::string_view bytes, std::string_view name);

}  // namespace scatter::images
