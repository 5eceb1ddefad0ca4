// Ctrl-C and SIGTERM as a stop token.
#pragma once

#include <stop_token>

namespace scatter::cli {

/// From now on the first SIGINT or SIGTERM requests a stop and the second ends the program at once with
/// status 1; SIGPIPE is ignored. Call once, from the main thread, before any other thread exists.
[[nodiscard]] std::stop_token stop_on_interrupt();

}  // namespace scatter::cli
