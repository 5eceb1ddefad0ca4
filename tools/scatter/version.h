// Version of the program, from the build.
#pragma once

namespace scatter::cli {

inline constexpr const char* kVersion = SCATTER_VERSION;

}  // namespace scatter::cli
