// Moments as text.
#pragma once

#include <cstdint>
#include <string>

namespace scatter::cli {

/// "2026-01-01 00:00:00 UTC" of nanoseconds since 1970; "unknown" for 0.
[[nodiscard]] std::string utc_text(std::uint64_t unix_ns);

}  // namespace scatter::cli
