#include "tools/scatter/usb_target.h"

#include <fmt/format.h>

#include <cstdio>

#include "host_sdk/device/uri.h"

namespace scatter::cli {

Result<device::usb::RescueChannel> open_rescue(const std::string& target, const Context& context) {
  using device::usb::RescueChannel;
  const device::Wait wait{.timeout = std::chrono::seconds(5), .stop = context.stop};
  if (target.find(':') == std::string::npos) {
    return RescueChannel::open(target, wait);
  }
  const auto uri = device::parse_uri(target);
  if (!uri) {
    return std::unexpected(uri.error());
  }
  if (uri->scheme == "usb" && uri->query.empty()) {
    if (uri->place.empty()) {
      return RescueChannel::open("", wait);
    }
    const auto equals = uri->place.find('=');
    const std::string key = uri->place.substr(0, equals);
    const std::string value = equals == std::string::npos ? "" : uri->place.substr(equals + 1);
    if (key == "serial" && !value.empty()) {
      return RescueChannel::open(value, wait);
    }
    if (key == "port" && !value.empty()) {
      return RescueChannel::open_at(value, wait);
    }
  }
  return fail(ErrorCode::kInvalidArgument, fmt::format("'{}' names no instrument on USB", target),
              "use usb:, usb:serial=SERIAL, usb:port=PORT or a serial number; scatter list shows them");
}

Status wait_for_button(const std::string& uri, const Context& context) {
  auto channel = open_rescue(uri, context);
  if (!channel) {
    return std::unexpected(channel.error());
  }
  // Before the person is asked: who presses at once shall not have to press again.
  const auto before = channel->status({.timeout = std::chrono::seconds(5), .stop = context.stop});
  if (!before) {
    return std::unexpected(before.error());
  }
  std::fputs("press the measure button on the instrument; ctrl-C gives up\n", stderr);
  while (true) {
    const Status pressed =
        channel->wait_for_button(*before, {.timeout = std::chrono::hours(1), .stop = context.stop});
    // A wait must have an end; people may take longer.
    if (pressed || pressed.error().code != ErrorCode::kDeadlineExceeded) {
      return pressed;
    }
  }
}

}  // namespace scatter::cli
