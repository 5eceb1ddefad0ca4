// What the HID interface can ask of the instrument, whatever the state of the bulk pipes.
#pragma once

#include "protocol/messages.h"
#include "protocol/rescue_report.h"

namespace scatter::firmware {

/// All calls act at once and are made from the main loop.
class RescueService {
 public:
  /// `dfu_mode` stays false: there is no HID interface in DFU mode.
  [[nodiscard]] virtual protocol::RescueStatus status() noexcept = 0;
  /// Ends the run as the message abort does. The host that started it gets run_finished with the reason
  /// "aborted" (or the reply of the stop that it waits for).
  [[nodiscard]] virtual protocol::StatusCode abort() noexcept = 0;
  /// Ends what is under way and restarts.
  virtual void reboot() noexcept = 0;
  [[nodiscard]] virtual protocol::FaultRecord fault_record() noexcept = 0;

 protected:
  ~RescueService() = default;
};

}  // namespace scatter::firmware
