#include "tests/usb/mock_bus/device_node.h"

#include <fcntl.h>
#include <stdlib.h>
#include <sys/stat.h>
#include <sys/sysmacros.h>
#include <termios.h>

#include <array>
#include <stdexcept>

namespace scatter::mock_bus {

DeviceNode::DeviceNode() : master_(::posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC)) {
  std::array<char, 64> name{};
  if (!master_.open() || ::grantpt(master_.number()) != 0 || ::unlockpt(master_.number()) != 0 ||
      ::ptsname_r(master_.number(), name.data(), name.size()) != 0) {
    throw std::runtime_error("no pseudo terminal for a device file: is /dev/pts mounted?");
  }
  path_ = name.data();
  slave_ = FileDescriptor(::open(name.data(), O_RDWR | O_NOCTTY | O_CLOEXEC));
  struct stat status{};
  termios modes{};
  if (!slave_.open() || ::fstat(slave_.number(), &status) != 0 || ::tcgetattr(slave_.number(), &modes) != 0) {
    throw std::runtime_error("cannot open " + path_);
  }
  major_ = ::major(status.st_rdev);
  minor_ = ::minor(status.st_rdev);
  ::cfmakeraw(&modes);
  ::tcsetattr(slave_.number(), TCSANOW, &modes);
  ::tcflow(slave_.number(), TCOOFF);
  set_access(true);
}

void DeviceNode::set_writable(bool on) {
  if (on != writable_ && slave_.open()) {
    ::tcflow(slave_.number(), on ? TCOON : TCOOFF);
    writable_ = on;
  }
}

void DeviceNode::set_readable(bool on) {
  if (on == readable_ || !slave_.open()) {
    return;
  }
  if (on) {
    (void)!::write(master_.number(), "", 1);
  } else {
    ::tcflush(slave_.number(), TCIFLUSH);
  }
  readable_ = on;
}

void DeviceNode::hang_up() {
  slave_.reset();
  master_.reset();
}

void DeviceNode::set_access(bool allowed) {
  ::chmod(path_.c_str(), allowed ? 0666 : 0000);
}

}  // namespace scatter::mock_bus
