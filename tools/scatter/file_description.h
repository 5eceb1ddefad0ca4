// What is in a file or behind a model's spec, whatever its kind.
#pragma once

#include <string>

#include "tools/scatter/verb.h"

namespace scatter::cli {

/// A recording, a calibration, a BRDF or BTDF in any format that can be read, or a model.
/// Errors   of the reader that the contents call for.
[[nodiscard]] Result<Answer> describe_file(const std::string& file_or_spec);

}  // namespace scatter::cli
