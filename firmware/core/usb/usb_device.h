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
#include <optional>
#include <span>

#include "firmware/core/dfu_device.h"
#include "firmware/core/step.h"
#include "firmware/core/usb/control_request.h"
#include "firmware/core/usb/rescue_endpoints.h"
#include "firmware/core/usb/rescue_service.h"
#include "firmware/core/usb/usb_descriptors.h"
#include "firmware/core/usb/usb_link.h"
#include "firmware/ports/ports.h"
#include "firmware/ports/usb_controller.h"

namespace scatter::firmware {

/// What the device stands on; all outlive it.
struct UsbParts {
  UsbController& controller;
  Clock& clock;
  Reset& reset;
  UsbLink& link;
  DfuDevice& dfu;                   ///< Made with interface number protocol::usb::kDfuInterface.
  RescueService* rescue = nullptr;  ///< Null: there is no application, DFU mode only.
};

/// RAM: 4840 B on a Cortex-M7, 4096 B of it for the data of a DFU block; no heap. Threads: one, that of the
/// main loop.
class UsbDevice {
 public:
  /// Off the bus for this long before it joins in another mode [us].
  static constexpr std::uint64_t kAwayUs = 250'000;
  /// Left to the host for the status stage of DETACH [us].
  static constexpr std::uint64_t kStatusStageUs = 20'000;

  UsbDevice(const UsbParts& parts, const UsbIdentity& identity) noexcept;
  UsbDevice(const UsbDevice&) = delete;
  UsbDevice& operator=(const UsbDevice&) = delete;

  /// One turn of the main loop, beside InstrumentCore::poll: joins the bus (the first time), takes a few
  /// events, moves rescue reports, does one bounded piece of a DFU download. Worst case: DfuDevice::poll.
  ///
  /// After DETACH it leaves the bus by itself and joins again in DFU mode; after a bus reset behind a
  /// finished download it leaves the bus, calls Reset::reboot, and does nothing more.
  ///
  /// wake_at_us: as InstrumentCore::poll's; an event of the controller, room in an IN endpoint and a press of
  /// the button call for an earlier turn.
  [[nodiscard]] Step poll() noexcept;

  /// A host has chosen the configuration.
  [[nodiscard]] bool configured() const noexcept { return configuration_ != 0; }
  /// Which descriptors are (or will be) shown.
  [[nodiscard]] UsbMode mode() const noexcept { return mode_; }
  /// The bus was left for good: the restart was asked for.
  [[nodiscard]] bool restarting() const noexcept { return presence_ == Presence::kGone; }

 private:
  enum class Presence : std::uint8_t { kAway, kOnBus, kGone };
  /// Whose OUT data stage is under way.
  enum class Receiving : std::uint8_t { kNothing, kReport, kBlock };

  void take(const UsbEvent& event) noexcept;
  void bus_reset() noexcept;
  void forget_host() noexcept;
  void leave() noexcept;

  void setup(const ControlRequest& request) noexcept;
  void data_stage(std::size_t size) noexcept;
  void answer(const ControlAnswer& answer) noexcept;
  [[nodiscard]] ControlAnswer class_request() noexcept;
  [[nodiscard]] ControlAnswer dfu_request(std::span<const std::byte> data) noexcept;
  [[nodiscard]] ControlAnswer vendor_request() noexcept;

  // usb_standard.cpp: USB 2.0, section 9.4.
  [[nodiscard]] ControlAnswer standard_request() noexcept;
  [[nodiscard]] ControlAnswer get_status() noexcept;
  [[nodiscard]] ControlAnswer change_feature(bool set) noexcept;
  [[nodiscard]] ControlAnswer set_address() noexcept;
  [[nodiscard]] ControlAnswer get_descriptor() noexcept;
  [[nodiscard]] ControlAnswer interface_descriptor() noexcept;
  [[nodiscard]] ControlAnswer get_configuration() noexcept;
  [[nodiscard]] ControlAnswer set_configuration() noexcept;
  [[nodiscard]] ControlAnswer get_interface() noexcept;
  [[nodiscard]] ControlAnswer set_interface() noexcept;
  /// wIndex names an interface of the configuration in force.
  [[nodiscard]] bool has_interface(std::uint16_t index) const noexcept;
  [[nodiscard]] bool has_endpoint(std::uint16_t index) const noexcept;
  /// Opens what configuration and setting have, closes the rest.
  void open_endpoints() noexcept;
  [[nodiscard]] ControlAnswer give(std::uint16_t value, std::size_t size) noexcept;

  UsbParts parts_;
  UsbIdentity identity_;
  std::optional<RescueEndpoints> rescue_;  // Absent without application.

  UsbMode mode_ = UsbMode::kRunTime;
  Presence presence_ = Presence::kAway;
  std::uint64_t join_at_us_ = 0;
  bool leaving_ = false;  // After DETACH.
  std::uint64_t leave_at_us_ = 0;

  std::uint8_t configuration_ = 0;
  std::uint8_t stream_setting_ = 0;

  ControlRequest request_;  // Under way, or the last one.
  Receiving receiving_ = Receiving::kNothing;
  usb_descriptors::Buffer buffer_{};  // What is being sent and does not lie in constants.
  std::array<std::byte, kDfuTransferBytes> block_{};
};

}  // namespace scatter::firmware
