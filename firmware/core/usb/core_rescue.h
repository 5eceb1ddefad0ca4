// The rescue commands over an instrument.
#pragma once

#include "firmware/core/instrument.h"
#include "firmware/core/usb/rescue_service.h"
#include "firmware/ports/ports.h"

namespace scatter::firmware {

/// RAM: 12 B on a Cortex-M7. Both outlive it.
class CoreRescue final : public RescueService {
 public:
  CoreRescue(InstrumentCore& core, Ports& ports) noexcept : core_(core), ports_(ports) {}

  [[nodiscard]] protocol::RescueStatus status() noexcept override;
  [[nodiscard]] protocol::StatusCode abort() noexcept override;
  void reboot() noexcept override;
  [[nodiscard]] protocol::FaultRecord fault_record() noexcept override;

 private:
  InstrumentCore& core_;
  Ports& ports_;
};

}  // namespace scatter::firmware
