// Maps and layers of a corroded sheet from what a person writes: a number, a colour or the name of an image.
#pragma once

#include <string>

#include "host_sdk/error/error.h"
#include "simulator/corrosion/appearance.h"
#include "simulator/corrosion/map.h"

namespace scatter::cli {

/// "0.7", or an EXR or PNG image: grey as stored, of colours the luminance (BT.709) of the numbers as stored.
/// Errors    name the parameter, the place of a value that is no number, and the file.
[[nodiscard]] Result<corrosion::Map> read_map(const std::string& parameter, const std::string& text);

/// The same into `to`, which stays as it is when the text is empty.
[[nodiscard]] Status take_map(const std::string& parameter, const std::string& text, corrosion::Map& to);

/// "0.3/0.13/0.05", or an image: EXR linear, PNG in sRGB, alpha left out.
[[nodiscard]] Result<corrosion::ColourMap> read_layer(const std::string& parameter, const std::string& text);

}  // namespace scatter::cli
