// A device file as poll() sees it: a pseudo terminal whose readiness this process decides.
#pragma once

#include <string>

#include "tests/usb/mock_bus/file_descriptor.h"

namespace scatter::mock_bus {

/// Bytes never travel through it: reads, writes and ioctls reach the mock by the preloaded library's socket.
/// What it gives is what a plain file cannot: poll() says "not ready" while there is nothing to reap or read,
/// so that an idle program sleeps, and POLLERR | POLLHUP once the device is gone.
class DeviceNode {
 public:
  /// Neither readable nor writable. Throws std::runtime_error where there are no pseudo terminals.
  DeviceNode();

  [[nodiscard]] const std::string& path() const noexcept { return path_; }
  [[nodiscard]] unsigned major() const noexcept { return major_; }
  [[nodiscard]] unsigned minor() const noexcept { return minor_; }
  /// POLLOUT for every program that has it open: a finished transfer can be reaped.
  void set_writable(bool on);
  /// POLLIN: a report can be read.
  void set_readable(bool on);
  /// POLLERR | POLLHUP from now on.
  void hang_up();
  /// Whether others than those who may do everything get EACCES.
  void set_access(bool allowed);

 private:
  FileDescriptor master_;
  FileDescriptor slave_;
  std::string path_;
  unsigned major_ = 0;
  unsigned minor_ = 0;
  bool writable_ = false;
  bool readable_ = false;
};

}  // namespace scatter::mock_bus
