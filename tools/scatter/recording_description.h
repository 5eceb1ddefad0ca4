// What is in a recording, for `info` and `inspect`.
#pragma once

#include <filesystem>

#include "tools/scatter/verb.h"

namespace scatter::cli {

/// True when the file starts like a recording.
[[nodiscard]] bool looks_like_recording(const std::filesystem::path& file);

/// Opens it, checks every checksum, counts its frames. Errors: as RecordingReader::open.
[[nodiscard]] Result<Answer> describe_recording(const std::filesystem::path& file);

}  // namespace scatter::cli
