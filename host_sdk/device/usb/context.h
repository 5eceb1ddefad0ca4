// USB of one program: the scheme usb:, the thread that serves transfers, and news of what is plugged in.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "host_sdk/device/transport.h"
#include "host_sdk/device/usb/bus_scan.h"
#include "host_sdk/error/error.h"

namespace scatter::device::usb {

/// An instrument came or went.
struct Change {
  enum class Kind { kArrived, kLeft };
  Kind kind = Kind::kArrived;
  std::string uri;  ///< "usb:serial=SC42"; "usb:port=1-1.4" when it has no serial number.
  std::string serial;
  bool dfu_mode = false;
};

struct Subscription;

/// Ends its subscription when destroyed; no call is under way or comes after that (unless it is destroyed
/// inside the call). May outlive the Context.
class Watch {
 public:
  Watch() = default;
  Watch(Watch&&) noexcept;
  Watch& operator=(Watch&&) noexcept;
  ~Watch();

 private:
  friend class Context;
  explicit Watch(std::shared_ptr<Subscription> subscription) noexcept;
  std::shared_ptr<Subscription> subscription_;
};

struct ContextOptions {
  int transfers = 16;  ///< Under way at once per device, 16..64, of protocol::usb::kTransferBytes each.
};

/// Owns libusb's context and its event thread.
///
/// Threads  any, also inside a Watch's call.
/// End      may be destroyed before, after or while devices opened through it are used: they end with
///          kDisconnected; the thread goes when the last of them is closed. Never waits longer than 200 ms.
class Context {
 public:
  /// Errors  kUnavailable: the system has no USB (no /dev/bus/usb), with what to do about it;
  /// kInvalidArgument:
  ///         options out of range; kUnimplemented: this build has no libusb.
  [[nodiscard]] static Result<Context> make(const ContextOptions& options = {});
  Context(Context&&) noexcept;
  Context& operator=(Context&&) noexcept;
  ~Context();

  /// usb:, usb:serial=SC42 and usb:port=1-1.4. Errors of opening:
  ///   kNotFound           none there, or not the named one (those there are listed);
  ///   kInvalidArgument    several and none named; an unknown key;
  ///   kBusy               another program holds it (named where that may be seen);
  ///   kPermissionDenied   with the udev rule's command;
  ///   kFailedPrecondition a stranger's device with our numbers, one in DFU mode, unreadable descriptors;
  ///   kResourceExhausted  usbfs memory, with the command that raises it;
  ///   kDeadlineExceeded   the device does not answer within `wait`.
  /// A device that is away is not waited for; one that has just come is, up to a second, until it can be
  /// opened.
  [[nodiscard]] Result<std::unique_ptr<Transport>> open(const Uri& uri, const Wait& wait) const;

  /// Adds the scheme usb: to a registry. It may outlive the context; opening then gives kFailedPrecondition.
  void add_scheme(TransportRegistry& registry) const;

  /// Calls `changed` for each arrival and removal from now on, from a thread of the context's that holds no
  /// lock: opening, closing and destroying are allowed in it. With `present` first for every instrument
  /// already there.
  [[nodiscard]] Watch watch(std::function<void(const Change&)> changed, bool present = false) const;

 private:
  struct State;
  explicit Context(std::shared_ptr<State> state) noexcept;
  std::shared_ptr<State> state_;
};

/// Adds the scheme usb: with a context of its own, which is made at the first opening and lives as long as
/// the registry: programs that only open instruments need no Context.
void add_usb_scheme(TransportRegistry& registry, const ContextOptions& options = {});

}  // namespace scatter::device::usb
