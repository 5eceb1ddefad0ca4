// Which instrument a rescue channel means, and why it cannot be had.
// Internal to this folder: programs use RescueChannel.
#pragma once

#include <string>
#include <string_view>

#include "host_sdk/device/usb/bus_scan.h"
#include "host_sdk/error/error.h"

namespace scatter::device::usb {

/// "instrument 'SC42' at USB port 1-1.4"
[[nodiscard]] std::string rescue_label(const BusEntry& entry);

/// The instrument with this serial number, or at this port; with both "" the only one there is.
/// Errors  as RescueChannel::open.
[[nodiscard]] Result<BusEntry> choose_rescue_target(std::string_view serial, std::string_view port);

/// Why hidapi did not open `path`: hidapi itself says no more than that it did not.
[[nodiscard]] std::unexpected<Error> rescue_not_opened(const BusEntry& entry, const std::string& path);

/// The interface is there, but hidapi sees no device for it.
[[nodiscard]] std::unexpected<Error> rescue_without_node(const BusEntry& entry);

}  // namespace scatter::device::usb
