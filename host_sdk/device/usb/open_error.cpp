#include "host_sdk/device/usb/open_error.h"

#include <libusb.h>
#include <unistd.h>

#include <string>

#include "host_sdk/device/usb/selection.h"
#include "host_sdk/device/usb/udev_rule.h"

namespace scatter::device::usb {
Error open_error(int libusb_error, const BusEntry& entry) {
  switch (libusb_error) {
    case LIBUSB_ERROR_ACCESS:
      return {ErrorCode::kPermissionDenied,
              label(entry) + ": " + entry.node().string() + " may not be opened by this user",
              "install the udev rule: " + std::string(kInstallUdevRule)};
    case LIBUSB_ERROR_BUSY:
      return busy_error(entry, find_holders(entry.node()), ::getpid());
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
