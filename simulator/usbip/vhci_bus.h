// This machine's own USB bus, as far as Linux's virtual host controller (vhci_hcd) lets programs plug devices
// in.
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "host_sdk/error/error.h"
#include "simulator/instrument/listener.h"

namespace scatter::simulator {

/// Threads: one at a time.
class VhciBus {
 public:
  /// `controller`: the driver's folder in sysfs.
  explicit VhciBus(std::filesystem::path controller = "/sys/devices/platform/vhci_hcd.0")
      : controller_(std::move(controller)) {}

  /// Whether attach() can work: the driver is there, and this program may use it.
  /// Errors    kNotFound: vhci_hcd is not loaded; kPermissionDenied: not root.
  [[nodiscard]] Status check() const;

  struct Attached {
    FileDescriptor connection;  ///< To the kernel, which sends CMD_ messages; closing it pulls the cable.
    std::uint32_t port = 0;     ///< As `usbip port` counts them.
  };
  /// Plugs a device into a free port. `device_id` and `speed`: as in USB/IP.
  /// Errors    those of check(); kBusy: no free port; kUnavailable: the kernel refuses.
  [[nodiscard]] Result<Attached> attach(std::uint32_t device_id, std::uint32_t speed) const;

 private:
  [[nodiscard]] std::vector<std::uint32_t> free_ports() const;

  std::filesystem::path controller_;
};

}  // namespace scatter::simulator
