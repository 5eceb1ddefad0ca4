// Why an instrument cannot be opened, with what to do about it. Internal to this folder.
#pragma once

#include "host_sdk/device/usb/bus_scan.h"
#include "host_sdk/error/error.h"

namespace scatter::device::usb {

/// For a libusb error number from opening, claiming or selecting. Names who holds the device where that may
/// be seen.
[[nodiscard]] Error open_error(int libusb_error, const BusEntry& entry);

}  // namespace scatter::device::usb
