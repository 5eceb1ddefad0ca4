// The firmware's USB part on the virtual board, from one boot to the next.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "firmware/core/dfu_device.h"
#include "firmware/core/instrument.h"
#include "firmware/core/step.h"
#include "firmware/core/update_receiver.h"
#include "firmware/core/usb/core_rescue.h"
#include "firmware/core/usb/usb_device.h"
#include "firmware/core/usb/usb_link.h"
#include "simulator/usb/virtual_usb_controller.h"

namespace scatter::simulator {

class VirtualBoard;

/// What a board's composition root makes: the link that the core gets, and once there is a core, the device
/// over both. In rescue mode of the bootloader there is none: DFU mode only. Stays where it is. Threads: one.
class UsbFirmware {
 public:
  /// `board` has a socket (VirtualBoard::usb()) and outlives this.
  explicit UsbFirmware(VirtualBoard& board);

  /// Goes into Ports::link.
  [[nodiscard]] firmware::UsbLink& link() noexcept { return link_; }
  /// An image runs: over its core. Both outlive this.
  void begin(firmware::InstrumentCore& core, firmware::Ports& ports);
  /// No image could be started.
  void begin_rescue();
  /// One turn; after begin() or begin_rescue(). In rescue mode it kicks the watchdog, as the bootloader's
  /// loop does.
  [[nodiscard]] firmware::Step poll() noexcept;

 private:
  void make_device(firmware::UpdateReceiver& receiver, firmware::Clock& clock, firmware::Reset& reset,
                   firmware::RescueService* rescue);

  VirtualBoard& board_;
  std::string product_;
  std::string serial_;
  firmware::UsbLink link_;
  std::optional<firmware::CoreRescue> rescue_;
  std::optional<firmware::UpdateReceiver> own_receiver_;  ///< Rescue mode; else the core's.
  std::optional<firmware::DfuDevice> dfu_;
  std::optional<firmware::UsbDevice> device_;
};

/// bcdDevice of a firmware version such as "1.2.3": 0x0123. Parts that have no room there count as their
/// greatest; a text that is no version gives 0.
[[nodiscard]] std::uint16_t release_bcd(std::string_view version) noexcept;

}  // namespace scatter::simulator
