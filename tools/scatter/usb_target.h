// USB instruments as people name them on the command line, and their rescue channels.
#pragma once

#include <string>

#include "host_sdk/device/usb/rescue_channel.h"
#include "host_sdk/error/error.h"
#include "tools/scatter/verb.h"

namespace scatter::cli {

/// Opens the rescue channel of "usb:", "usb:serial=SC42", "usb:port=1-1.4" or a plain serial number, within 5
/// s. Errors  kInvalidArgument: another scheme or key; those of RescueChannel::open.
[[nodiscard]] Result<device::usb::RescueChannel> open_rescue(const std::string& target,
                                                             const Context& context);

/// Asks for the measure button on standard error and waits until it is pressed or the user stops.
/// Errors  kAborted: stopped; kInvalidArgument: not a usb: URI; those of RescueChannel.
[[nodiscard]] Status wait_for_button(const std::string& uri, const Context& context);

}  // namespace scatter::cli
