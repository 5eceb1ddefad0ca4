// libusb's context and the thread that completes its transfers. Internal to this folder.
#pragma once

#include <functional>
#include <memory>
#include <mutex>
#include <stop_token>
#include <thread>

#include "host_sdk/error/error.h"

struct libusb_context;

namespace scatter::device::usb {

/// Shared by everything that has transfers under way; the thread ends with the last owner, which is never the
/// thread itself: callbacks hold no owning reference.
class EventLoop {
 public:
  /// Errors  kUnavailable: the system has no USB.
  [[nodiscard]] static Result<std::shared_ptr<EventLoop>> make();
  ~EventLoop();
  EventLoop(const EventLoop&) = delete;
  EventLoop& operator=(const EventLoop&) = delete;

  [[nodiscard]] libusb_context* context() const noexcept { return context_; }
  /// Calls `hint` from the thread when a device with our vendor number comes or goes. One at a time: a later
  /// call replaces it. It must not wait and may outlive who gave it. False: this system does not tell.
  bool hint_changes(std::function<void()> hint);

 private:
  explicit EventLoop(libusb_context* context);

  libusb_context* context_;
  std::mutex mutex_;
  std::shared_ptr<const std::function<void()>> hint_;
  bool registered_ = false;
  std::jthread thread_;
};

}  // namespace scatter::device::usb
