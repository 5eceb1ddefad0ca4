// The simulated instrument as something to plug into the mocked bus.
#pragma once

#include <memory>
#include <string_view>

#include "host_sdk/error/error.h"
#include "tests/usb/mock_bus/host_port.h"

namespace scatter::mock_bus {

/// `query` as for simulator::parse_instrument_options. Errors  as there, and VirtualInstrument::make's.
[[nodiscard]] Result<std::unique_ptr<Peripheral>> plugged_instrument(std::string_view query);

}  // namespace scatter::mock_bus
