// The instrument on a USB bus: descriptors, control requests (USB 2.0 chapter 9, HID 1.11, DFU 1.1,
// Microsoft OS 2.0), the rescue channel, and the change to DFU mode and back. SPEC.md section 11.
//
//   UsbLink link(controller);                       // goes into Ports::link
//   InstrumentCore core(ports, memory);
//   CoreRescue rescue(core, ports);
//   DfuDevice dfu(clock, slots, *core.update_receiver(), product, protocol::usb::kDfuInterface);
//   UsbDevice usb({controller, clock, reset, link, dfu, &rescue}, identity);
//   for (;;) { const Step a = usb.poll(); const Step b = core.poll(); ... }
//
// A bootloader without an image to start makes the same without core and rescue, over an UpdateReceiver of
// its own: its DfuDevice begins in dfuERROR, and the device joins the bus in DFU mode at once.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include "firmware/core/dfu_device.h"
#include "firmware/core/step.h"
#include "firmware/core/usb/rescue_service.h"
#include "firmware/core/usb/usb_link.h"
#include "firmware/ports/ports.h"
#include "firmware/ports/usb_controller.h"

namespace scatter::firmware {

/// Who is on the bus. UTF-8, at most 126 UTF-16 units each; the views outlive the device.
struct UsbIdentity {
  std::string_view manufacturer;
  std::string_view product;
  std::string_view serial;         ///< Unique; empty = none. For Windows: 0x20..0x7E without comma.
  std::uint16_t release_bcd = 0;   ///< bcdDevice: 0x0102 is 1.2.
  bool high_speed_capable = true;  ///< Of the controller; else there is no device qualifier.
};

/// What the device stands on; all outlive it.
struct UsbParts {
  UsbController& controller;
  Clock& clock;
  Reset& reset;
  UsbLink& link;
  DfuDevice& dfu;                   ///< Made with interface number protocol::usb::kDfuInterface.
  RescueService* rescue = nullptr;  ///< Null: there is no application, DFU mode only.
};

/// RAM: see usb_device.cpp's static_assert; no heap. Threads: one, that of the main loop.
class UsbDevice {
 public:
  /// Off the bus for this long before it joins in another mode [us].
  static constexpr std::uint64_t kAwayUs = 250'000;

  UsbDevice(const UsbParts& parts, const UsbIdentity& identity) noexcept;
  UsbDevice(const UsbDevice&) = delete;
  UsbDevice& operator=(const UsbDevice&) = delete;

  /// One turn of the main loop, beside InstrumentCore::poll: joins the bus (the first time), takes a few
  /// events, moves rescue reports, does one bounded piece of a DFU download. Worst case: DfuDevice::poll.
  ///
  /// After DETACH it leaves the bus by itself and joins again in DFU mode; after a bus reset behind a
  /// finished download it leaves the bus and calls Reset::reboot, and does nothing more.
  [[nodiscard]] Step poll() noexcept;

  /// A host has chosen the configuration.
  [[nodiscard]] bool configured() const noexcept { return configuration_ != 0; }
  /// The DFU-mode descriptors are (or will be) shown.
  [[nodiscard]] bool dfu_mode() const noexcept { return dfu_mode_; }

 private:
  UsbParts parts_;
  UsbIdentity identity_;
  std::uint8_t configuration_ = 0;
  bool dfu_mode_ = false;
};

}  // namespace scatter::firmware
