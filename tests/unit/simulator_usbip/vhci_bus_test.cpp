// Against a folder that looks like the driver's; the driver itself is in the suite on a real kernel
// (tests/vm).
#include "simulator/usbip/vhci_bus.h"

#include <fcntl.h>
#include <unistd.h>

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>

#include <catch2/catch.hpp>

namespace {

using namespace scatter;
using simulator::VhciBus;
namespace fs = std::filesystem;

/// What /sys/devices/platform/vhci_hcd.0 has on Linux 6.1.
class Driver {
 public:
  explicit Driver(const std::string& ports)
      : folder_(fs::temp_directory_path() / ("vhci_bus_test_" + std::to_string(::getpid()))) {
    fs::create_directories(folder_);
    std::ofstream(folder_ / "status") << "hub port sta spd dev      sockfd local_busid\n" << ports;
    std::ofstream(folder_ / "attach");
  }
  ~Driver() { fs::remove_all(folder_); }
  [[nodiscard]] const fs::path& folder() const { return folder_; }
  [[nodiscard]] std::string attached() const {
    std::ostringstream text;
    text << std::ifstream(folder_ / "attach").rdbuf();
    return text.str();
  }

 private:
  fs::path folder_;
};

TEST_CASE("A device goes into the first free port of the right hub, with its socket, id and speed") {
  const Driver driver(
      "hs  0000 006 003 00010002 000003 1-1\n"
      "hs  0001 004 000 00000000 000000 0-0\n"
      "hs  0002 004 000 00000000 000000 0-0\n"
      "ss  0008 004 000 00000000 000000 0-0\n");
  const auto attached = VhciBus(driver.folder()).attach(0x10002, 3);
  REQUIRE(attached.has_value());
  CHECK(attached->port == 1);
  unsigned port = 0;
  int socket = -1;
  unsigned device = 0;
  unsigned speed = 0;
  REQUIRE(std::sscanf(driver.attached().c_str(), "%u %d %u %u", &port, &socket, &device, &speed) == 4);
  CHECK(port == 1);
  CHECK(socket > 2);
  CHECK(device == 65538);
  CHECK(speed == 3);
  // The kernel keeps its end, this program does not: what is closed here is closed.
  CHECK(::fcntl(socket, F_GETFD) == -1);
  CHECK((::fcntl(attached->connection.number(), F_GETFL) & O_NONBLOCK) != 0);
}

TEST_CASE("A bus without a free port says how to free one") {
  const Driver driver("hs  0000 006 003 00010002 000003 1-1\nss  0008 004 000 00000000 000000 0-0\n");
  const auto attached = VhciBus(driver.folder()).attach(0x10002, 3);
  REQUIRE_FALSE(attached.has_value());
  CHECK(attached.error().code == ErrorCode::kBusy);
  CHECK_THAT(attached.error().remedy, Catch::Matchers::Contains("usbip detach"));
}

TEST_CASE("A missing driver is named with the command that loads it") {
  const VhciBus bus("/sys/devices/platform/there_is_no_such_driver.0");
  const Status usable = bus.check();
  REQUIRE_FALSE(usable.has_value());
  CHECK(usable.error().code == ErrorCode::kNotFound);
  CHECK_THAT(usable.error().remedy, Catch::Matchers::Contains("sudo modprobe vhci-hcd"));
  CHECK_FALSE(bus.attach(0x10002, 3).has_value());
}

}  // namespace
