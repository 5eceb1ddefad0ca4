// vm_rescue_hidraw, vm_rescue_libusb COMMAND [SERIAL]: one request on the HID interface, with the backend of
// hidapi that the name says. status, abort, reboot, fault, button (waits 10 s for a press).
#include <fmt/format.h>

#include <cstdio>
#include <string>

#include "host_sdk/device/usb/rescue_channel.h"

using namespace scatter;

namespace {

int report(const Error& error) {
  fmt::print("error {}: {}; {}\n", name(error.code), error.what, error.remedy);
  return 1;
}

int done(const Status& status, std::string_view what) {
  if (!status) {
    return report(status.error());
  }
  fmt::print("{}\n", what);
  return 0;
}

}  // namespace

int main(int count, char** words) {
  if (count < 2) {
    fmt::print("usage: vm_rescue_BACKEND status|abort|reboot|fault|button [SERIAL]\n");
    return 2;
  }
  const std::string command = words[1];
  auto channel = device::usb::RescueChannel::open(count > 2 ? words[2] : "");
  if (!channel) {
    return report(channel.error());
  }
  if (command == "status") {
    const auto status = channel->status();
    if (!status) {
      return report(status.error());
    }
    fmt::print("run_state {} session_open {} button_presses {} exposed {} uptime_us {}\n", status->run_state,
               static_cast<int>(status->session_open), status->button_presses, status->exposed,
               status->uptime_us);
    return 0;
  }
  if (command == "abort") {
    return done(channel->abort(), "aborted");
  }
  if (command == "reboot") {
    return done(channel->reboot(), "restarts");
  }
  if (command == "button") {
    fmt::print("waiting\n");
    std::fflush(stdout);
    return done(channel->wait_for_button({.timeout = std::chrono::seconds(10)}), "pressed");
  }
  if (command == "fault") {
    const auto record = channel->fault_record();
    if (!record) {
      return report(record.error());
    }
    fmt::print("present {}\n", static_cast<int>(record->present));
    return 0;
  }
  fmt::print("unknown command {}\n", command);
  return 2;
}
