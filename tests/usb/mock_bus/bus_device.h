// A device on the mocked bus: its entries in /sys and /dev, the drivers bound to it, and usbfs.
#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <list>
#include <memory>
#include <string>
#include <vector>

#include "tests/usb/mock_bus/caller.h"
#include "tests/usb/mock_bus/device_node.h"
#include "tests/usb/mock_bus/hidraw.h"
#include "tests/usb/mock_bus/host_port.h"
#include "tests/usb/mock_bus/tally.h"
#include "tests/usb/mock_bus/testbed.h"
#include "tests/usb/mock_bus/usbfs_file.h"

namespace scatter::mock_bus {

/// What a test has set for devices to come and devices there.
struct BusConditions {
  std::uint64_t memory_limit = 16'000'000;  ///< usbfs_memory_mb, in bytes; 0: none.
  bool access = true;                       ///< Others may open the device files.
  bool hid_driver = true;                   ///< The kernel has usbhid.
  int garble = -1;                          ///< >= 0: the descriptors that programs read are cut there.
  std::uint32_t scramble = 0;               ///< != 0: seed of random bytes in their place.
  bool hold_received = false;               ///< What devices sent, and that they have left, is told late.
  bool hold_sent = false;                   ///< What became of transfers to devices is told late.
};

class BusDevice final : public FileHandler {
 public:
  struct Place {
    std::string port = "1-1";
    unsigned bus = 1;
    unsigned address = 2;
    unsigned speed_mbps = 480;
  };
  BusDevice(Testbed& testbed, HostPort& host, Tally& tally, const BusConditions& conditions,
            Enumerated enumerated, Place place);
  ~BusDevice() override;

  void opened(Caller& caller) override;
  void called(Caller& caller, const Call& call) override;
  void closed(Caller& caller) override;

  void add_waits(std::vector<pollfd>& files) const;
  bool serve();
  /// The device has left: transfers have ended, files report it, entries go, news goes out.
  void leave();
  [[nodiscard]] bool gone() const noexcept { return gone_; }
  /// Gone, and no program has it open or is about to.
  [[nodiscard]] bool finished() const noexcept;
  /// Finished bulk transfers wait for a program to take them.
  [[nodiscard]] bool program_is_slow() const;
  [[nodiscard]] std::size_t under_way() const;
  void set_access(bool allowed);
  /// What the conditions held back is given to programs.
  void release_held();
  /// Another program of the test's imagination holds this interface, or no longer.
  void hold_by_other(std::uint8_t interface, bool held);
  [[nodiscard]] const Place& place() const noexcept { return place_; }
  [[nodiscard]] const Enumerated& enumerated() const noexcept { return enumerated_; }

 private:
  using Binding = std::string;  ///< Name of the bound driver; "" for none, "usbfs" for a program.
  struct InterfaceState {
    Binding driver;
    const UsbfsFile* holder = nullptr;  ///< With "usbfs"; null: another program.
    std::uint8_t setting = 0;
  };

  // bus_device.cpp
  void add_entries();
  void bind_hid(std::uint8_t interface, bool announced);
  void unbind_hid();
  void set_driver(std::uint8_t interface, const Binding& driver);
  [[nodiscard]] SysDevice interface_entry(const Enumerated::Interface& interface) const;
  void drop_interface(UsbfsFile& file, std::uint8_t interface);
  void cancel_endpoints(UsbfsFile& file, std::uint8_t interface);
  void update_readiness();
  [[nodiscard]] const Enumerated::Interface* interface_of(std::uint8_t endpoint) const;
  [[nodiscard]] bool has_interface(std::uint8_t number) const;

  // usbfs_calls.cpp
  void submit(UsbfsFile& file, const Call& call);
  void reap(UsbfsFile& file, const Call& call);
  void discard(UsbfsFile& file, const Call& call);
  [[nodiscard]] int claim(UsbfsFile& file, std::uint8_t interface);
  [[nodiscard]] int release(UsbfsFile& file, std::uint8_t interface);
  void set_interface(UsbfsFile& file, const Call& call);
  void clear_halt(UsbfsFile& file, const Call& call);
  void set_configuration(UsbfsFile& file, const Call& call);
  void reset(UsbfsFile& file);
  void get_driver(UsbfsFile& file, const Call& call);
  void driver_ioctl(UsbfsFile& file, const Call& call);
  void disconnect_claim(UsbfsFile& file, const Call& call);
  [[nodiscard]] int disconnect(std::uint8_t interface);
  void control_later(UsbfsFile& file, const Setup& setup, std::function<void()> then = {});
  [[nodiscard]] bool used_unclaimed(UsbfsFile& file, std::uint8_t interface);
  /// The oldest finished transfer that a program may have now.
  [[nodiscard]] std::deque<Urb>::iterator ready_urb(UsbfsFile& file) const;
  void take_urb(UsbfsFile& file, std::uint64_t id, simulator::UsbCompletion& completion);

  Testbed& testbed_;
  HostPort& host_;
  Tally& tally_;
  const BusConditions& conditions_;
  Enumerated enumerated_;
  Place place_;
  SysDevice entry_;
  std::vector<SysDevice> interface_entries_;
  DeviceNode node_;
  CallServer server_;
  std::list<UsbfsFile> files_;
  std::array<InterfaceState, 8> interfaces_;
  std::unique_ptr<Hidraw> hidraw_;
  std::vector<std::unique_ptr<Hidraw>> old_hidraws_;  ///< Unbound, and still open in some program.
  bool gone_ = false;
  std::chrono::steady_clock::time_point left_at_;
  std::shared_ptr<bool> alive_ = std::make_shared<bool>(true);
};

}  // namespace scatter::mock_bus
