#include "host_sdk/device/usb/open_error.h"

#include <libusb.h>
#include <unistd.h>

#include <string>
#include <vector>

#include "host_sdk/device/usb/selection.h"
#include "host_sdk/device/usb/udev_rule.h"

namespace scatter::device::usb {
namespace {

std::string holder_list(const BusEntry& entry) {
  std::string out;
  for (const Holder& one : find_holders(entry.node())) {
    out += (out.empty() ? "" : ", ") +
           (one.process_id == ::getpid() ? std::string("this program") : one.program) + " (" +
           std::to_string(one.process_id) + ")";
  }
  return out.empty() ? "another program" : out;
}

}  // namespace

Error open_error(int libusb_error, const BusEntry& entry) {
  switch (libusb_error) {
    case LIBUSB_ERROR_ACCESS:
      return {ErrorCode::kPermissionDenied,
              label(entry) + ": " + entry.node().string() + " may not be opened by this user",
              "install the udev rule: " + std::string(kInstallUdevRule)};
    case LIBUSB_ERROR_BUSY:
      return {ErrorCode::kBusy, label(entry) + " is in use by " + holder_list(entry),
              "close that program, or wait for it"};
    case LIBUSB_ERROR_NO_DEVICE:
    case LIBUSB_ERROR_NOT_FOUND:
      return {ErrorCode::kDisconnected, label(entry) + " was unplugged while it was being opened",
              "plug it in again"};
    case LIBUSB_ERROR_NO_MEM:
      return {ErrorCode::kResourceExhausted, label(entry) + ": the system has no memory for its transfers",
              "echo 128 | sudo tee /sys/module/usbcore/parameters/usbfs_memory_mb"};
    default:
      return {ErrorCode::kUnavailable,
              label(entry) + ": " + ::libusb_strerror(static_cast<enum libusb_error>(libusb_error)),
              "unplug it and plug it in again"};
  }
}

}  // namespace scatter::device::usb
