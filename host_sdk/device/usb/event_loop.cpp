#include "host_sdk/device/usb/event_loop.h"

#include <libusb.h>
#include <sys/time.h>

#include <string>
#include <system_error>
#include <utility>

#include "host_sdk/device/usb/bounded_call.h"
#include "protocol/usb_identity.h"

namespace scatter::device::usb {
namespace {

/// How long the thread sleeps when nothing happens; libusb_interrupt_event_handler() wakes it.
constexpr timeval kIdle{.tv_sec = 0, .tv_usec = 200'000};

}  // namespace

Result<std::shared_ptr<EventLoop>> EventLoop::make() {
  libusb_context* context = nullptr;
  const int failed = ::libusb_init(&context);
  if (failed != 0) {
    return fail(
        ErrorCode::kUnavailable,
        std::string("this system has no USB: ").append(::libusb_strerror(static_cast<libusb_error>(failed))),
        "sudo modprobe usbcore; in a container, pass /dev/bus/usb into it");
  }
  try {
    return std::shared_ptr<EventLoop>(new EventLoop(context));
  } catch (const std::system_error& error) {
    ::libusb_exit(context);
    return fail(ErrorCode::kResourceExhausted, std::string("no thread for USB: ").append(error.what()),
                "close other programs");
  }
}

EventLoop::EventLoop(libusb_context* context)
    : context_(context), thread_(quiet_thread([context](const std::stop_token& stop) {
        while (!stop.stop_requested()) {
          timeval idle = kIdle;
          (void)::libusb_handle_events_timeout_completed(context, &idle, nullptr);
        }
      })) {}

EventLoop::~EventLoop() {
  thread_.request_stop();
  ::libusb_interrupt_event_handler(context_);
  thread_.join();
  ::libusb_exit(context_);
}

bool EventLoop::hint_changes(std::function<void()> hint) {
  {
    const std::lock_guard lock(mutex_);
    hint_ = std::make_shared<const std::function<void()>>(std::move(hint));
    if (std::exchange(registered_, true)) {
      return true;
    }
  }
  if (::libusb_has_capability(LIBUSB_CAP_HAS_HOTPLUG) == 0) {
    return false;
  }
  const auto call = [](libusb_context*, libusb_device*, libusb_hotplug_event, void* self) -> int {
    auto* const loop = static_cast<EventLoop*>(self);
    std::shared_ptr<const std::function<void()>> known;
    {
      const std::lock_guard lock(loop->mutex_);
      known = loop->hint_;
    }
    (*known)();
    return 0;
  };
  return ::libusb_hotplug_register_callback(
             context_, LIBUSB_HOTPLUG_EVENT_DEVICE_ARRIVED | LIBUSB_HOTPLUG_EVENT_DEVICE_LEFT, 0,
             protocol::usb::kVendorId, LIBUSB_HOTPLUG_MATCH_ANY, LIBUSB_HOTPLUG_MATCH_ANY, call, this,
             nullptr) == LIBUSB_SUCCESS;
}

}  // namespace scatter::device::usb
