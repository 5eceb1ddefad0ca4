// The instrument's HID interface: status, button, abort, reboot and crash record while the bulk pipes are
// stuck or held by another program.
#pragma once

#include <memory>
#include <string_view>

#include "host_sdk/device/wait.h"
#include "host_sdk/error/error.h"
#include "protocol/messages.h"
#include "protocol/rescue_report.h"

namespace scatter::device::usb {

/// Works beside a Device that streams, in this program or another.
///
/// Threads  any; hidapi itself is only ever called from one thread that all channels of the program share.
/// Waits    each call ends at its deadline and within 20 ms of a stop request.
/// Errors   kNotFound: no such instrument, or it has no HID interface; kPermissionDenied, with the udev
/// rule's
///          command; kDeadlineExceeded; kDisconnected: unplugged, open it again.
class RescueChannel {
 public:
  /// `serial` "": the only instrument there is.
  [[nodiscard]] static Result<RescueChannel> open(std::string_view serial, const Wait& wait = {});
  RescueChannel(RescueChannel&&) noexcept;
  RescueChannel& operator=(RescueChannel&&) noexcept;
  ~RescueChannel();

  [[nodiscard]] Result<protocol::RescueStatus> status(const Wait& wait = {});
  /// Ends the run under way, whoever started it; its host sees the run end as aborted.
  [[nodiscard]] Status abort(const Wait& wait = {});
  [[nodiscard]] Status reboot(const Wait& wait = {});
  /// present == 0: none since power-on.
  [[nodiscard]] Result<protocol::FaultRecord> fault_record(const Wait& wait = {});
  /// Waits for the next press of the measure button.
  [[nodiscard]] Status wait_for_button(const Wait& wait);

 private:
  struct State;
  explicit RescueChannel(std::unique_ptr<State> state) noexcept;
  std::unique_ptr<State> state_;
};

}  // namespace scatter::device::usb
