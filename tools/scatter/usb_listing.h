// USB instruments for `scatter list`: looked up in the system's tables, none is opened.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "host_sdk/device/usb/bus_scan.h"

namespace scatter::cli {

/// One entry's row for text_table(): URI, state, product, serial number, bus and firmware, what to do.
[[nodiscard]] std::vector<std::string> row_of(const device::usb::BusEntry& entry,
                                              const device::usb::SystemRoot& root);
/// uri, state, product, serial, detail, remedy as every listing; port, speed_mbps, firmware, holders.
[[nodiscard]] nlohmann::ordered_json to_json(const device::usb::BusEntry& entry,
                                             const device::usb::SystemRoot& root);

}  // namespace scatter::cli
