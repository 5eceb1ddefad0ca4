// Endpoint 0: control transfers, one at a time.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <span>

#include "firmware/ports/usb_controller.h"
#include "simulator/usb/usb_completions.h"
#include "simulator/usb/usb_port.h"

namespace scatter::simulator {

/// The host's transfers wait for each other; the device answers the one whose SETUP it has taken. An answer
/// to a transfer that was cancelled meanwhile goes nowhere, as a new SETUP ends the old transfer on a bus.
/// Threads: one.
class ControlPipe {
 public:
  explicit ControlPipe(UsbCompletions& completions) : completions_(completions) {}

  // The host's side.
  void submit(UsbTransfer transfer);
  [[nodiscard]] bool cancel(std::uint64_t id);
  void end_all(UsbOutcome outcome);
  [[nodiscard]] std::size_t under_way() const noexcept { return transfers_.size(); }

  // The device's side; see firmware::UsbController.
  /// kSetup or kControlData, where one is due.
  [[nodiscard]] std::optional<firmware::UsbEvent> next_event();
  void send(std::span<const std::byte> data);
  void receive(std::span<std::byte> room);
  void accept();
  void stall();

 private:
  enum class Stage : std::uint8_t {
    kSetup,   ///< The device has not seen it.
    kAnswer,  ///< It is the device's turn.
    kData,    ///< Bytes lie in the device's room, which has not been told.
  };

  [[nodiscard]] bool answerable() const noexcept { return !transfers_.empty() && stage_ == Stage::kAnswer; }
  void finish(UsbOutcome outcome, std::vector<std::byte> data, std::size_t actual);

  UsbCompletions& completions_;
  std::deque<UsbTransfer> transfers_;
  Stage stage_ = Stage::kSetup;
  std::size_t received_ = 0;  ///< Bytes of the OUT data stage that the device has.
};

}  // namespace scatter::simulator
