// Interface 1: the HID requests (HID 1.11) and the reports of SPEC.md section 12.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "firmware/core/step.h"
#include "firmware/core/usb/control_request.h"
#include "firmware/core/usb/rescue_service.h"
#include "firmware/ports/ports.h"
#include "firmware/ports/usb_controller.h"
#include "protocol/rescue_report.h"

namespace scatter::firmware {

/// Commands act when they arrive, whether or not anybody reads the answers: the last kAnswers of them wait
/// for the host, older ones are dropped. RAM: 376 B on a Cortex-M7, no heap. Threads: one, that of the main
/// loop.
class RescueEndpoints {
 public:
  static constexpr std::size_t kAnswers = 4;
  /// A reboot waits this long for its answer to leave [us].
  static constexpr std::uint64_t kRebootGraceUs = 200'000;

  /// All outlive it.
  RescueEndpoints(UsbController& controller, Clock& clock, RescueService& service) noexcept
      : controller_(controller), clock_(clock), service_(service) {}

  /// The configuration was chosen: the endpoints are new. What the instrument is now is known to the host.
  void open() noexcept;
  /// A class request to the interface; kReceive: call take() with the bytes.
  [[nodiscard]] ControlAnswer request(const ControlRequest& request) noexcept;
  /// The data of the last request that was answered by kReceive.
  [[nodiscard]] ControlAnswer take(std::span<const std::byte> data) noexcept;

  /// While configured: one output report, one input report.
  [[nodiscard]] Step poll() noexcept;
  /// A reboot that was asked for; call it whether or not configured.
  [[nodiscard]] Step reboot_when_due() noexcept;

 private:
  void execute(std::span<const std::byte> report) noexcept;
  [[nodiscard]] protocol::StatusCode fault_record(std::uint16_t offset,
                                                  protocol::RescueAnswer& answer) noexcept;
  void queue(const protocol::RescueAnswer& answer) noexcept;
  void look() noexcept;
  [[nodiscard]] bool send_next() noexcept;

  UsbController& controller_;
  Clock& clock_;
  RescueService& service_;

  std::array<protocol::Report, kAnswers> answers_{};
  std::size_t first_ = 0, count_ = 0;  // Of answers_, a ring.
  bool status_due_ = false;
  std::uint8_t told_run_state_ = 0;
  bool told_session_ = false;
  std::uint32_t told_presses_ = 0;
  std::uint8_t idle_ = 0;  // SET_IDLE, in 4 ms; 0 = only changes.
  std::uint64_t told_at_us_ = 0;
  bool reboot_ = false;
  std::uint64_t reboot_at_us_ = 0;
  protocol::Report reply_{};  // Of GET_REPORT and GET_IDLE, until the next event.
};

}  // namespace scatter::firmware
