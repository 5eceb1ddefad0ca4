#include "firmware/core/usb/core_rescue.h"

namespace scatter::firmware {

protocol::RescueStatus CoreRescue::status() noexcept {
  protocol::RescueStatus status;
  status.run_state = static_cast<std::uint8_t>(core_.run_state());
  status.reset_reason = static_cast<std::uint8_t>(ports_.reset.reason());
  status.session_open = core_.session_open();
  status.fault_recorded = ports_.reset.fault_record().present != 0;
  status.button_presses = ports_.button != nullptr ? ports_.button->presses() : 0;
  status.boot_count = core_.boot_count();
  status.run_id = core_.run_report().run_id;
  status.exposed = static_cast<std::uint32_t>(core_.run_report().ledger.exposed);
  status.worst_poll_us = core_.worst_poll_us();
  status.uptime_us = ports_.clock.now_us();
  status.sensor_mK = ports_.thermometer.sensor_mK();
  status.led_board_mK = ports_.thermometer.led_board_mK();
  return status;
}

protocol::StatusCode CoreRescue::abort() noexcept {
  core_.abort();
  return protocol::StatusCode::kOk;
}

void CoreRescue::reboot() noexcept {
  core_.reboot();
}

protocol::FaultRecord CoreRescue::fault_record() noexcept {
  return ports_.reset.fault_record();
}

}  // namespace scatter::firmware
