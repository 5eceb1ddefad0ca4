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

/// Works beside a Device that streams, in this program or another. A request is sent once; only questions
/// (status, fault_record) are repeated when their answer is lost.
///
/// Threads  any; hidapi itself is only ever called from one thread that all channels of the program share.
/// Waits    each call ends at its deadline and within 20 ms of a stop request.
/// Errors   kNotFound: no such instrument, or it has no HID interface; kPermissionDenied, with the udev
/// rule's
///          command; kDeadlineExceeded; kDisconnected: unplugged, open it again.
class RescueChannel {
 public:
  /// `serial` "": the only instrument there is. kInvalidArgument: several and none named;
  /// kFailedPrecondition: a stranger's device with our numbers, or one in DFU mode.
  [[nodiscard]] static Result<RescueChannel> open(std::string_view serial, const Wait& wait = {});
  /// By its socket ("1-1.4"), for instruments without a serial number. Errors  as open().
  [[nodiscard]] static Result<RescueChannel> open_at(std::string_view port, const Wait& wait = {});
  RescueChannel(RescueChannel&&) noexcept;
  RescueChannel& operator=(RescueChannel&&) noexcept;
  ~RescueChannel();

  /// Over the interrupt pipes; over the control pipe when those are silent for 250 ms.
  [[nodiscard]] Result<protocol::RescueStatus> status(const Wait& wait = {});
  /// Ends the run under way, whoever started it; its host sees the run end as aborted.
  [[nodiscard]] Status abort(const Wait& wait = {});
  /// The answer, or the instrument's leaving the bus, is success. Open the channel again afterwards.
  [[nodiscard]] Status reboot(const Wait& wait = {});
  /// present == 0: none since power-on.
  [[nodiscard]] Result<protocol::FaultRecord> fault_record(const Wait& wait = {});
  /// Waits for the next press of the measure button after this call began. A restart meanwhile is a
  /// kDisconnected.
  [[nodiscard]] Status wait_for_button(const Wait& wait);
  /// The same, for the next press after `since` was taken with status(): one between that and this call
  /// counts.
  [[nodiscard]] Status wait_for_button(const protocol::RescueStatus& since, const Wait& wait);

 private:
  struct State;
  explicit RescueChannel(std::unique_ptr<State> state) noexcept;
  std::unique_ptr<State> state_;
};

}  // namespace scatter::device::usb
