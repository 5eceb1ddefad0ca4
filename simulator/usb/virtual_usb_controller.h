// A USB device controller that is not there: registers for the firmware, a socket for a host.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <list>
#include <optional>
#include <span>
#include <utility>

#include "firmware/ports/ports.h"
#include "firmware/ports/usb_controller.h"
#include "simulator/faults/fault_plan.h"
#include "simulator/faults/lane_faults.h"
#include "simulator/usb/control_pipe.h"
#include "simulator/usb/in_pipe.h"
#include "simulator/usb/out_pipe.h"
#include "simulator/usb/usb_completions.h"
#include "simulator/usb/usb_port.h"
#include "simulator/usb/usb_transfer_faults.h"

namespace scatter::simulator {

/// Both ends of the cable. Transfers to endpoints that the device has not opened end with kError; those that
/// wait on an endpoint which it opens anew go on waiting, with its queue emptied.
///
/// Faults    drop, corrupt, ... harm wire frames on the bulk pipes; stall holds back what crosses the host's
///           edge; disconnect unplugs the cable there, as a hub that loses power does: whoever owns the port
///           plugs it again. usb_stall, usb_short, usb_babble strike IN transfers of the bulk pipe.
/// Memory    InPipe::kBulkCapacity and OutPipe::kBulkCapacity, plus what the host has submitted.
/// Threads   one. Stays where it is.
class VirtualUsbController final : public firmware::UsbController, public UsbPort {
 public:
  /// `since_power_on` must go on through restarts, and outlive this.
  VirtualUsbController(firmware::Clock& since_power_on, const FaultPlan& plan, std::uint64_t seed);

  // The device's side.
  void connect(bool on) noexcept override;
  [[nodiscard]] firmware::UsbSpeed speed() noexcept override;
  [[nodiscard]] firmware::UsbEvent next_event() noexcept override;
  void control_send(std::span<const std::byte> data) noexcept override;
  void control_receive(std::span<std::byte> room) noexcept override;
  void control_accept() noexcept override;
  void control_stall() noexcept override;
  void set_address(std::uint8_t address) noexcept override;
  void open_endpoints(std::span<const firmware::UsbEndpoint> endpoints) noexcept override;
  [[nodiscard]] std::size_t write(std::uint8_t endpoint, std::span<const std::byte> bytes) noexcept override;
  void end_transfer(std::uint8_t endpoint) noexcept override;
  [[nodiscard]] std::size_t waiting(std::uint8_t endpoint) noexcept override;
  [[nodiscard]] std::size_t read(std::uint8_t endpoint, std::span<std::byte> out) noexcept override;
  void set_halt(std::uint8_t endpoint, bool halted) noexcept override;
  [[nodiscard]] bool halted(std::uint8_t endpoint) noexcept override;

  // The host's side.
  void plug(UsbBusSpeed speed) override;
  void unplug() override;
  [[nodiscard]] bool plugged() const override { return plugged_; }
  [[nodiscard]] bool present() const override { return plugged_ && joined_; }
  [[nodiscard]] std::uint32_t joins() const override { return joins_; }
  void reset() override;
  void submit(UsbTransfer transfer) override;
  bool cancel(std::uint64_t id) override;
  [[nodiscard]] std::optional<UsbCompletion> next_completion() override;
  [[nodiscard]] std::size_t under_way() const override;
  [[nodiscard]] bool host_is_slow() const override;

  /// Called whenever the host has taken the last completion.
  void on_completion_taken(std::function<void()> call) { completion_taken_ = std::move(call); }

  /// Lets what was held back for too long go on. Call whenever time has moved.
  void tick();
  /// When something changes by itself [us since power-on]: a stall ends, a held frame goes on.
  [[nodiscard]] std::optional<std::uint64_t> next_event_us() const noexcept;

  [[nodiscard]] std::uint8_t address() const noexcept { return address_; }
  /// Of wire frames on the bulk pipes.
  [[nodiscard]] const FaultCounts& fault_counts(Direction direction) const noexcept {
    return direction == Direction::kToHost ? to_host_.counts() : to_device_.counts();
  }
  [[nodiscard]] const UsbFaultCounts& usb_fault_counts() const noexcept { return transfers_.counts(); }

 private:
  [[nodiscard]] InPipe* in_pipe(std::uint8_t endpoint) noexcept;
  [[nodiscard]] OutPipe* out_pipe(std::uint8_t endpoint) noexcept;
  void appear();
  /// Every transfer ends with kGone, every endpoint is closed, nothing that happened before counts.
  void clear_bus();

  firmware::Clock& clock_;
  LaneFaults to_host_;
  LaneFaults to_device_;
  UsbTransferFaults transfers_;
  InPipe::Faults in_faults_{to_host_, transfers_};
  UsbCompletions completions_;
  std::function<void()> completion_taken_;
  ControlPipe control_{completions_};
  std::list<InPipe> ins_;
  std::list<OutPipe> outs_;
  std::deque<firmware::UsbEvent> events_;  ///< Of the bus; control transfers keep their own.
  UsbBusSpeed speed_ = UsbBusSpeed::kHigh;
  bool plugged_ = false;
  bool joined_ = false;
  std::uint32_t joins_ = 0;
  std::uint8_t address_ = 0;
};

}  // namespace scatter::simulator
