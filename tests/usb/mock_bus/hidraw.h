// The kernel's hidraw driver on one interface: a device file that gives and takes reports.
#pragma once

#include <chrono>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <string>

#include "tests/usb/mock_bus/caller.h"
#include "tests/usb/mock_bus/device_node.h"
#include "tests/usb/mock_bus/host_port.h"
#include "tests/usb/mock_bus/tally.h"
#include "tests/usb/mock_bus/testbed.h"

namespace scatter::mock_bus {

/// Bound to the interface as long as it lives. Interrupt transfers are under way while a program has the file
/// open.
class Hidraw final : public FileHandler {
 public:
  struct Place {
    std::string interface_path;  ///< Of the USB interface in /sys.
    int number = 0;              ///< hidrawN
    bool announced = true;       ///< Tell udev monitors at once.
  };
  Hidraw(Testbed& testbed, HostPort& host, Tally& tally, const Enumerated& enumerated,
         const Enumerated::Interface& interface, Place place);
  ~Hidraw() override;

  void opened(Caller& caller) override;
  void called(Caller& caller, const Call& call) override;
  void closed(Caller& caller) override;

  void add_waits(std::vector<pollfd>& files) const { server_.add_waits(files); }
  bool serve() { return server_.serve(); }
  /// The driver was unbound or the device left: files report errors from now on.
  void detach();
  /// Detached, and no program has it open or is about to.
  [[nodiscard]] bool finished() const noexcept {
    return !attached_ && !server_.in_use() && std::chrono::steady_clock::now() > detached_at_ + kLateOpens;
  }
  void set_access(bool allowed) { node_.set_access(allowed); }

 private:
  struct File {
    std::deque<Bytes> reports;
    std::optional<Call> reading;  ///< A read that waits.
  };
  void listen();
  void give(Caller& caller, File& file, const Call& call);
  void update_readiness();
  void take_ioctl(Caller& caller, const Call& call);
  void feature(Caller& caller, const Call& call, bool to_host);
  void write(Caller& caller, const Call& call);

  Testbed& testbed_;
  HostPort& host_;
  Tally& tally_;
  std::uint8_t interface_ = 0;
  std::uint8_t in_ = 0;
  std::uint8_t out_ = 0;
  std::uint16_t vendor_ = 0;
  std::uint16_t product_ = 0;
  std::string name_;
  Bytes report_descriptor_;
  DeviceNode node_;
  SysDevice hid_;
  SysDevice hidraw_;
  CallServer server_;
  std::map<Caller*, File> files_;
  std::uint64_t listening_ = 0;  ///< Id of the interrupt transfer; 0: none.
  bool attached_ = true;
  std::chrono::steady_clock::time_point detached_at_;
  /// Callbacks may come after the object's end.
  std::shared_ptr<bool> alive_ = std::make_shared<bool>(true);
};

}  // namespace scatter::mock_bus
