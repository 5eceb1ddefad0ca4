// USB instruments as they come and go, for `scatter list --watch`.
#pragma once

#include "host_sdk/error/error.h"
#include "tools/scatter/verb.h"

namespace scatter::cli {

/// Prints arrivals and removals, those present first, until the user stops. With JSON one object per line.
/// Errors  of usb::Context::make.
[[nodiscard]] Result<Answer> watch_bus(const Context& context);

}  // namespace scatter::cli
