// A device that is none of ours and carries our vendor and product numbers.
#pragma once

#include <chrono>
#include <deque>

#include "tests/usb/mock_bus/host_port.h"

namespace scatter::mock_bus {

/// A thermostat of somebody else's: one vendor interface of another subclass, two bulk endpoints that never
/// move a byte, no HID. Whoever sends it anything of ours would see that it is not for it.
class Stranger final : public Peripheral, private simulator::UsbPort {
 public:
  [[nodiscard]] simulator::UsbPort& port() override { return *this; }
  std::uint64_t run_ready() override;
  [[nodiscard]] std::uint64_t now_us() const override { return now_us_; }
  void advance_to(std::uint64_t time_us) override { now_us_ = time_us > now_us_ ? time_us : now_us_; }
  [[nodiscard]] simulator::ClockMode clock_mode() const override { return simulator::ClockMode::kVirtual; }

 private:
  void plug(simulator::UsbBusSpeed speed) override;
  void unplug() override;
  [[nodiscard]] bool plugged() const override { return plugged_; }
  [[nodiscard]] bool present() const override { return plugged_; }
  [[nodiscard]] std::uint32_t joins() const override { return joins_; }
  void reset() override { end_all(simulator::UsbOutcome::kGone); }
  void submit(simulator::UsbTransfer transfer) override;
  bool cancel(std::uint64_t id) override;
  [[nodiscard]] std::optional<simulator::UsbCompletion> next_completion() override;
  [[nodiscard]] std::size_t under_way() const override { return under_way_.size(); }
  [[nodiscard]] bool host_is_slow() const override { return false; }

  void end(std::uint64_t id, simulator::UsbOutcome outcome, Bytes data = {});
  void end_all(simulator::UsbOutcome outcome);
  void answer(const simulator::UsbTransfer& transfer);

  std::uint64_t now_us_ = 0;
  bool plugged_ = false;
  std::uint32_t joins_ = 0;
  std::deque<simulator::UsbTransfer> under_way_;
  std::deque<simulator::UsbCompletion> done_;
};

}  // namespace scatter::mock_bus
