#include "host_sdk/device/usb/rescue_target.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <vector>

#include "host_sdk/device/usb/udev_rule.h"

namespace scatter::device::usb {
namespace {

std::string list(const std::vector<BusEntry>& entries) {
  std::string text;
  for (const BusEntry& entry : entries) {
    if (entry.ours) {
      text += (text.empty() ? "" : ", ") + (entry.serial.empty() ? "port " + entry.port : entry.serial);
    }
  }
  return text;
}

}  // namespace

std::string rescue_label(const BusEntry& entry) {
  return entry.serial.empty() ? "the instrument at USB port " + entry.port
                              : "instrument '" + entry.serial + "' at USB port " + entry.port;
}

Result<BusEntry> choose_rescue_target(std::string_view serial, std::string_view port) {
  const std::vector<BusEntry> entries = scan_bus();
  std::vector<BusEntry> fitting;
  for (const BusEntry& entry : entries) {
    const bool named = !serial.empty() ? entry.serial == serial : port.empty() || entry.port == port;
    // Strangers and DFU mode count only when they are meant.
    if (named &&
        ((entry.ours && !entry.dfu_mode) || !serial.empty() || !port.empty() || entries.size() == 1)) {
      fitting.push_back(entry);
    }
  }
  if (fitting.empty()) {
    const std::string there = list(entries);
    const std::string who = !serial.empty() ? "instrument '" + std::string(serial) + "'"
                            : !port.empty() ? "instrument at USB port " + std::string(port)
                                            : std::string("instrument");
    return fail(ErrorCode::kNotFound,
                "no " + who + " is plugged in" + (there.empty() ? "" : "; there are: " + there),
                there.empty() ? "plug it in and switch it on; scatter doctor looks for the cause"
                              : "name one of those; scatter list shows them");
  }
  if (fitting.size() > 1) {
    return fail(
        ErrorCode::kInvalidArgument,
        serial.empty() ? "several instruments are plugged in: " + list(fitting)
                       : "several instruments have the serial number '" + std::string(serial) + "'",
        serial.empty() ? "name one by its serial number" : "name it by its port; scatter list shows it");
  }
  const BusEntry& entry = fitting.front();
  if (!entry.ours) {
    return fail(ErrorCode::kFailedPrecondition,
                "the device at USB port " + entry.port +
                    " has an instrument's numbers but not its interfaces: it is something else",
                "unplug it, or name your instrument by its serial number");
  }
  if (entry.dfu_mode) {
    return fail(ErrorCode::kFailedPrecondition,
                rescue_label(entry) + " waits for firmware (DFU mode) and has no rescue channel there",
                "unplug it and plug it in again; if it stays so: scatter flash usb: IMAGE.scfw");
  }
  if (!entry.rescue_interface) {
    return fail(ErrorCode::kNotFound, rescue_label(entry) + " has no HID interface",
                "update its firmware: scatter flash usb:serial=" + entry.serial + " IMAGE.scfw");
  }
  return entry;
}

std::unexpected<Error> rescue_not_opened(const BusEntry& entry, const std::string& path) {
  const std::string node = path.starts_with('/') ? path : entry.node().string();
  const int file = ::open(node.c_str(), O_RDWR | O_CLOEXEC | O_NONBLOCK);
  const int reason = file < 0 ? errno : 0;
  if (file >= 0) {
    ::close(file);
  }
  if (reason == EACCES || reason == EPERM) {
    return fail(ErrorCode::kPermissionDenied,
                rescue_label(entry) + ": " + node + " may not be opened by this user",
                "install the udev rule: " + std::string(kInstallUdevRule));
  }
  if (reason == ENOENT || reason == ENODEV || reason == ENXIO) {
    return fail(ErrorCode::kDisconnected, rescue_label(entry) + " was unplugged", "plug it in again");
  }
  return fail(ErrorCode::kBusy, rescue_label(entry) + ": its HID interface cannot be opened",
              "close the program that holds it, or unplug it and plug it in again");
}

std::unexpected<Error> rescue_without_node(const BusEntry& entry) {
  return fail(ErrorCode::kNotFound,
              rescue_label(entry) + ": its HID interface is there, but the system made no device for it",
              "sudo modprobe usbhid, then unplug the instrument and plug it in again");
}

}  // namespace scatter::device::usb
