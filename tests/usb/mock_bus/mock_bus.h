// The mocked machine: its bus, the conditions on it, and the loop that serves every program's calls.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "host_sdk/error/error.h"
#include "tests/usb/mock_bus/caller.h"
#include "tests/usb/mock_bus/control_server.h"
#include "tests/usb/mock_bus/slot.h"
#include "tests/usb/mock_bus/tally.h"
#include "tests/usb/mock_bus/testbed.h"

namespace scatter::mock_bus {

/// Answers calls that the mock has nothing to say about: on other device files, and on root hubs.
class OtherFiles final : public FileHandler {
 public:
  void opened(Caller& /*caller*/) override {}
  void called(Caller& caller, const Call& /*call*/) override { caller.answer(Caller::kUnhandled); }
  void closed(Caller& /*caller*/) override {}
};

class MockBus {
 public:
  MockBus();

  /// A socket with this in it, not plugged in yet. Gives its number, from 0.
  int add(std::unique_ptr<Peripheral> peripheral);
  /// As simulator::parse_instrument_options.
  [[nodiscard]] Result<int> add_instrument(std::string_view query);
  /// One whose firmware speaks only this wire major. `refuses`: OtherWire::Manner.
  [[nodiscard]] Result<int> add_of_other_wire(std::string_view query, std::uint8_t major, bool refuses);
  void plug(int slot, unsigned speed_mbps) { slots_.at(static_cast<std::size_t>(slot))->plug(speed_mbps); }

  /// One request of a test (bus_control.h): "ok ..." or "error ...".
  [[nodiscard]] std::string request(const std::string& line);

  /// Serves until `ended` (a file descriptor) can be read.
  void serve_until(int ended);
  /// What a correct program leaves behind is nothing; one line for each thing that is wrong.
  [[nodiscard]] std::vector<std::string> complaints() const;
  [[nodiscard]] const Testbed& testbed() const noexcept { return testbed_; }
  [[nodiscard]] const std::string& control_path() const noexcept { return control_.path(); }

 private:
  void add_root_hub(int number);
  void set_memory_limit(std::uint64_t bytes);
  [[nodiscard]] std::string statistics() const;
  [[nodiscard]] bool serve();

  Testbed testbed_;
  Tally tally_;
  BusConditions conditions_;
  OtherFiles other_files_;
  CallServer default_server_;
  std::vector<std::unique_ptr<CallServer>> hub_servers_;
  std::vector<std::unique_ptr<DeviceNode>> hub_nodes_;
  std::vector<std::unique_ptr<Slot>> slots_;
  ControlServer control_;
  bool may_abandon_ = false;
};

}  // namespace scatter::mock_bus
