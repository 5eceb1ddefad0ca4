// The host SDK's carrier over the virtual USB socket: what the usb: transport does through libusb, here
// without a kernel, so that Device::open works on the socket.
#pragma once

#include <deque>
#include <memory>
#include <string>

#include "host_sdk/device/transport.h"
#include "tests/usb/port_host.h"

namespace scatter::usb_test {

/// Plugs, enumerates and opens the stream; null: that failed. Closing selects alternate setting 0 and leaves
/// the cable in.
/// Lends each completed transfer's buffer; a halt is cleared and a babble counted, and both go on.
[[nodiscard]] std::unique_ptr<device::Transport> make_port_transport(
    std::shared_ptr<simulator::VirtualInstrument> instrument);

}  // namespace scatter::usb_test
