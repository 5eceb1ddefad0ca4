// What a written file does not hold of the data it was made from, with the figures of these data.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "host_sdk/error/error.h"
#include "host_sdk/formats/save_brdf.h"
#include "host_sdk/reflectance/brdf.h"

namespace scatter::formats {

/// One clause each; empty: nothing is lost.
///
/// source  the data as they were opened: of them the Dirac share counts.
/// written what the writer was given: the source, or estimators around it.
/// bytes   what encode_brdf made of it with these options. It is read back and asked at the
///         incidences of the data, at most 12, in directions that are nobody's nodes.
/// Errors  those of decode_brdf.
/// Cost    70,000 evaluations of `written` at most, besides reading the file.
[[nodiscard]] Result<std::vector<std::string>> conversion_losses(const reflectance::Brdf& source,
                                                                 const reflectance::Brdf& written,
                                                                 const Writer& writer,
                                                                 const EncodeOptions& options,
                                                                 std::string_view bytes);

}  // namespace scatter::formats
