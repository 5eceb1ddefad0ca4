// How much memory this machine can still give.
#pragma once

#include <cstdint>

#include "host_sdk/error/error.h"

namespace scatter::cli {

/// Bytes that new work may take without swapping: what the system calls available, else all there is; 0 when
/// it does not say.
[[nodiscard]] std::uint64_t available_memory() noexcept;

}  // namespace scatter::cli
