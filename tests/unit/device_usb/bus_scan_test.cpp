#include <unistd.h>

#include <catch2/catch.hpp>
#include <cstdlib>
#include <fstream>

#include "firmware/core/usb/usb_descriptors.h"
#include "host_sdk/device/usb/bus_scan.h"
#include "host_sdk/device/usb/selection.h"

namespace scatter::device::usb {
namespace {

namespace fs = std::filesystem;

/// A folder that looks like the root of a Linux system, by the kernel's Documentation/ABI (sysfs-bus-usb).
class Root {
 public:
  Root() {
    std::string pattern = (fs::temp_directory_path() / "scatter-bus-XXXXXX").string();
    REQUIRE(::mkdtemp(pattern.data()) != nullptr);
    root_.path = pattern;
  }
  ~Root() { fs::remove_all(root_.path); }
  Root(const Root&) = delete;
  Root& operator=(const Root&) = delete;

  void file(const fs::path& name, const std::string& content) {
    fs::create_directories((root_.path / name).parent_path());
    std::ofstream(root_.path / name, std::ios::binary) << content;
  }
  void link(const fs::path& name, const fs::path& target) {
    fs::create_directories((root_.path / name).parent_path());
    fs::create_symlink(target, root_.path / name);
  }
  /// An instrument as the kernel shows it.
  void instrument(const std::string& port, int address, const std::string& serial) {
    namespace told = firmware::usb_descriptors;
    const fs::path at = fs::path("sys/bus/usb/devices") / port;
    told::Buffer buffer{};
    std::string bytes;
    for (const auto part : {told::device(buffer, firmware::UsbMode::kRunTime, {}),
                            told::configuration(firmware::UsbMode::kRunTime, firmware::UsbSpeed::kHigh,
                                                told::Type::kConfiguration)}) {
      bytes.append(reinterpret_cast<const char*>(part.data()), part.size());
    }
    file(at / "descriptors", bytes);
    file(at / "idVendor", "1209\n");
    file(at / "idProduct", "000d\n");
    file(at / "bcdDevice", "0102\n");
    file(at / "busnum", "1\n");
    file(at / "devnum", std::to_string(address) + "\n");
    file(at / "speed", "480\n");
    file(at / "product", "OpenScatter\n");
    file(at / "serial", serial + "\n");
    for (int k = 0; k < 3; ++k) {
      file(fs::path(at.string() + ":1." + std::to_string(k)) / "bInterfaceNumber",
           "0" + std::to_string(k) + "\n");
    }
  }
  [[nodiscard]] std::vector<BusEntry> scan() const { return scan_bus(root_); }
  [[nodiscard]] fs::path device(const std::string& port) const {
    return fs::path("sys/bus/usb/devices") / port;
  }

 private:
  SystemRoot root_;
};

TEST_CASE("A computer without USB has nothing on its bus") {
  const Root root;
  CHECK(root.scan().empty());
}

TEST_CASE("An instrument is listed with everything that the system knows of it") {
  Root root;
  root.instrument("1-1.4", 7, "SC42");
  root.file("sys/bus/usb/devices/1-1.4:1.1/0003:1209:000D.0001/hidraw/hidraw3/dev", "243:3\n");
  const auto found = root.scan();
  REQUIRE(found.size() == 1);
  const BusEntry& one = found.front();
  CHECK(one.port == "1-1.4");
  CHECK(one.node() == "/dev/bus/usb/001/007");
  CHECK(one.serial == "SC42");
  CHECK(one.product == "OpenScatter");
  CHECK(one.release == 0x0102);
  CHECK(one.speed_mbps == 480);
  CHECK(one.ours);
  CHECK(one.rescue_interface);
  CHECK_FALSE(one.dfu_mode);
  CHECK_FALSE(one.in_use);
  REQUIRE(one.hidraw.size() == 1);
  CHECK(one.hidraw.front() == "/dev/hidraw3");
}

TEST_CASE("A claimed stream interface is in use, and who has the node open is named") {
  Root root;
  root.instrument("1-1.4", 7, "SC42");
  root.link("sys/bus/usb/devices/1-1.4:1.0/driver", "../../../../bus/usb/drivers/usbfs");
  root.file("proc/4711/comm", "scatter\n");
  root.link("proc/4711/fd/5", "/dev/bus/usb/001/007");
  root.file("proc/4712/comm", "other\n");
  root.link("proc/4712/fd/5", "/dev/bus/usb/001/008");
  const auto found = root.scan();
  REQUIRE(found.size() == 1);
  CHECK(found.front().in_use);
  CHECK(found.front().stream_driver == "usbfs");
  REQUIRE(found.front().holders.size() == 1);
  CHECK(found.front().holders.front().process_id == 4711);
  CHECK(found.front().holders.front().program == "scatter");
}

TEST_CASE("Other devices, root hubs and interfaces are no instruments") {
  Root root;
  root.instrument("1-2", 8, "SC43");
  root.file("sys/bus/usb/devices/usb1/idVendor", "1d6b\n");
  root.file("sys/bus/usb/devices/1-3/idVendor", "046d\n");
  root.file("sys/bus/usb/devices/1-3/idProduct", "000d\n");
  REQUIRE(root.scan().size() == 1);
  CHECK(root.scan().front().serial == "SC43");
}

TEST_CASE("Garbage in any attribute gives an entry that is not believed, or none") {
  for (const char* name : {"descriptors", "idVendor", "idProduct", "bcdDevice", "busnum", "devnum", "speed",
                           "product", "serial"}) {
    for (const std::string& garbage : {std::string(), std::string("\xff\xfe\x00\x1b[2J", 8),
                                       std::string(100000, '9'), std::string("-1\n")}) {
      INFO(name << ": " << garbage.size() << " bytes");
      Root root;
      root.instrument("1-1", 3, "SC42");
      root.file(root.device("1-1") / name, garbage);
      for (const BusEntry& one : root.scan()) {
        CHECK(one.address == 3);
        CHECK(one.ours == (std::string_view(name) != "descriptors"));
        CHECK(one.readable == one.ours);
        for (const char c : one.product + one.serial) {
          CHECK(static_cast<unsigned char>(c) >= 0x20);
        }
      }
    }
  }
}

TEST_CASE("The same instrument at another address has left and come again") {
  BusEntry before;
  before.port = "1-1";
  before.address = 3;
  before.serial = "SC42";
  BusEntry after = before;
  after.address = 4;
  CHECK(missing_in({before}, {before}).empty());
  CHECK(missing_in({before}, {after}).size() == 1);
  CHECK(missing_in({after}, {before}).size() == 1);
}

}  // namespace
}  // namespace scatter::device::usb
