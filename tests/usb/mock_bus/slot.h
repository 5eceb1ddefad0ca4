// A socket of the mocked bus: what is plugged into it, and the device that programs see there.
#pragma once

#include <chrono>
#include <list>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "simulator/instrument/pace.h"
#include "tests/usb/mock_bus/bus_device.h"
#include "tests/usb/mock_bus/host_port.h"

namespace scatter::mock_bus {

/// Between a hub losing power and the hub's driver noticing it: transfers fail meanwhile.
inline constexpr std::chrono::milliseconds kHubNotices{60};

class Slot {
 public:
  Slot(Testbed& testbed, Tally& tally, const BusConditions& conditions,
       std::unique_ptr<Peripheral> peripheral, int number);

  void plug(unsigned speed_mbps);
  void unplug();
  /// Power is gone: transfers fail at once, the device leaves a little later.
  void cut_power();
  /// Everything that the device and its host can do now.
  void run();
  bool serve();
  /// What the conditions held back is given to programs.
  void release_held();
  void add_waits(std::vector<pollfd>& files) const;
  /// How long nothing happens here by itself [us]. Then call passed().
  [[nodiscard]] std::uint64_t wait_us();
  void passed();

  [[nodiscard]] BusDevice* device() noexcept { return device_.get(); }
  [[nodiscard]] Peripheral& peripheral() noexcept { return *peripheral_; }
  void set_hung(bool hung) { host_.hung = hung; }
  void set_speed(unsigned speed_mbps) { speed_mbps_ = speed_mbps; }

 private:
  void leave();
  void enumerate();
  [[nodiscard]] bool slow() const;

  Testbed& testbed_;
  Tally& tally_;
  const BusConditions& conditions_;
  std::unique_ptr<Peripheral> peripheral_;
  HostPort host_;
  simulator::Pace pace_;
  int number_ = 0;
  unsigned next_address_ = 2;
  unsigned speed_mbps_ = 480;
  std::unique_ptr<BusDevice> device_;
  std::list<std::unique_ptr<BusDevice>> left_;  ///< Still open in some program.
  std::uint32_t seen_joins_ = 0;
  std::uint64_t wake_us_ = 0;
  std::optional<std::chrono::steady_clock::time_point> leaves_at_;
};

}  // namespace scatter::mock_bus
