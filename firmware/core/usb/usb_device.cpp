// Bus events, modes, and who answers which control request.
#include "firmware/core/usb/usb_device.h"

#include <algorithm>

#include "protocol/usb_identity.h"

namespace scatter::firmware {
namespace {

namespace usb = protocol::usb;

// Events per turn: a chatty host must not starve the sensor.
constexpr int kEventsPerTurn = 4;
// DFU 1.1, table 3.2.
constexpr std::uint8_t kClassToInterface = 0x21;
constexpr std::uint8_t kClassFromInterface = 0xA1;
constexpr std::uint8_t kVendorFromDevice = 0xC0;
// A request code that DFU does not have.
constexpr std::uint8_t kNoDfuRequest = 0xFF;

[[nodiscard]] std::uint64_t earlier(std::uint64_t a, std::uint64_t b) noexcept {
  return a == 0 || b == 0 ? std::max(a, b) : std::min(a, b);
}

[[nodiscard]] Step both(const Step& a, const Step& b) noexcept {
  return {.did_work = a.did_work || b.did_work, .wake_at_us = earlier(a.wake_at_us, b.wake_at_us)};
}

}  // namespace

UsbDevice::UsbDevice(const UsbParts& parts, const UsbIdentity& identity) noexcept
    : parts_(parts), identity_(identity) {
  if (parts.rescue != nullptr) {
    rescue_.emplace(parts.controller, parts.clock, *parts.rescue);
  } else {
    mode_ = UsbMode::kDfu;
  }
}

Step UsbDevice::poll() noexcept {
  const std::uint64_t now = parts_.clock.now_us();
  Step step{.did_work = false, .wake_at_us = now + kLongestSleepUs};
  if (presence_ == Presence::kGone) {
    return step;
  }
  if (presence_ == Presence::kAway) {
    if (now < join_at_us_) {
      step.wake_at_us = earlier(step.wake_at_us, join_at_us_);
      return step;
    }
    presence_ = Presence::kOnBus;
    parts_.controller.connect(true);
    step.did_work = true;
  }
  for (int i = 0; i < kEventsPerTurn && presence_ == Presence::kOnBus; ++i) {
    const UsbEvent event = parts_.controller.next_event();
    if (event.kind == UsbEvent::Kind::kNone) {
      break;
    }
    step.did_work = true;
    take(event);
  }
  if (leaving_) {
    if (now >= leave_at_us_) {
      leave();
      return {.did_work = true, .wake_at_us = now};
    }
    step.wake_at_us = earlier(step.wake_at_us, leave_at_us_);
  }
  step.did_work = parts_.link.turn() || step.did_work;
  if (rescue_) {
    if (configured() && mode_ == UsbMode::kRunTime) {
      step = both(step, rescue_->poll());
    }
    step = both(step, rescue_->reboot_when_due());
  }
  parts_.dfu.poll();
  step.did_work = parts_.dfu.busy() || step.did_work;
  return step;
}

void UsbDevice::take(const UsbEvent& event) noexcept {
  switch (event.kind) {
    case UsbEvent::Kind::kReset:
      bus_reset();
      return;
    case UsbEvent::Kind::kUnplugged:
      forget_host();
      return;
    case UsbEvent::Kind::kSetup:
      setup(ControlRequest::parse(event.setup));
      return;
    case UsbEvent::Kind::kControlData:
      data_stage(event.size);
      return;
    case UsbEvent::Kind::kSuspended:  // The pipes keep what they hold; runs wait for room or credit.
    case UsbEvent::Kind::kResumed:
    case UsbEvent::Kind::kNone:
      return;
  }
}

void UsbDevice::forget_host() noexcept {
  configuration_ = 0;
  stream_setting_ = usb::kStreamIdleSetting;
  receiving_ = Receiving::kNothing;
  parts_.link.close();
  parts_.controller.open_endpoints({});
}

void UsbDevice::bus_reset() noexcept {
  forget_host();
  leaving_ = false;  // A reset does as well.
  switch (parts_.dfu.bus_reset()) {
    case DfuAfterReset::kRunTime:
      mode_ = rescue_ ? UsbMode::kRunTime : UsbMode::kDfu;
      return;
    case DfuAfterReset::kDfuMode:
      mode_ = UsbMode::kDfu;
      return;
    case DfuAfterReset::kRestart:
      presence_ = Presence::kGone;
      parts_.controller.connect(false);
      parts_.reset.reboot();
      return;
  }
}

/// After DETACH. For the state machine of DFU the device's own leaving is the reset that it waits for.
void UsbDevice::leave() noexcept {
  parts_.controller.connect(false);
  bus_reset();
  if (presence_ == Presence::kOnBus) {
    presence_ = Presence::kAway;
    join_at_us_ = parts_.clock.now_us() + kAwayUs;
  }
}

void UsbDevice::setup(const ControlRequest& request) noexcept {
  request_ = request;
  receiving_ = Receiving::kNothing;
  switch (request.kind()) {
    case ControlRequest::Kind::kStandard:
      answer(standard_request());
      return;
    case ControlRequest::Kind::kClass:
      answer(class_request());
      return;
    case ControlRequest::Kind::kVendor:
      answer(vendor_request());
      return;
    case ControlRequest::Kind::kReserved:
      answer(ControlAnswer::stall());
      return;
  }
}

void UsbDevice::data_stage(std::size_t size) noexcept {
  const auto data = std::span<const std::byte>(block_).first(std::min(size, block_.size()));
  const Receiving what = receiving_;
  receiving_ = Receiving::kNothing;
  switch (what) {
    case Receiving::kReport:
      answer(rescue_ ? rescue_->take(data) : ControlAnswer::stall());
      return;
    case Receiving::kBlock:
      answer(dfu_request(data));
      return;
    case Receiving::kNothing:
      return;  // Of a request that a reset or another SETUP ended.
  }
}

void UsbDevice::answer(const ControlAnswer& answer) noexcept {
  switch (answer.kind) {
    case ControlAnswer::Kind::kStall:
      parts_.controller.control_stall();
      return;
    case ControlAnswer::Kind::kAccept:
      parts_.controller.control_accept();
      return;
    case ControlAnswer::Kind::kSend:
      if (!request_.to_host()) {
        parts_.controller.control_stall();
      } else if (request_.length == 0) {
        parts_.controller.control_accept();
      } else {
        parts_.controller.control_send(
            answer.data.first(std::min<std::size_t>(answer.data.size(), request_.length)));
      }
      return;
    case ControlAnswer::Kind::kReceive:
      parts_.controller.control_receive(std::span(block_).first(request_.length));
      return;
  }
}

ControlAnswer UsbDevice::class_request() noexcept {
  if (request_.recipient() != ControlRequest::Recipient::kInterface || !has_interface(request_.index)) {
    return ControlAnswer::stall();
  }
  const std::uint8_t dfu = mode_ == UsbMode::kDfu ? usb::kDfuModeInterface : usb::kDfuInterface;
  if (request_.index == dfu) {
    const bool block = request_.type == kClassToInterface &&
                       request_.request == static_cast<std::uint8_t>(DfuRequestCode::kDnload);
    if (block && request_.length > 0 && request_.length <= block_.size()) {
      receiving_ = Receiving::kBlock;
      return ControlAnswer::receive();
    }
    return dfu_request({});
  }
  if (request_.index == usb::kRescueInterface && rescue_) {
    const ControlAnswer answer = rescue_->request(request_);
    receiving_ = answer.kind == ControlAnswer::Kind::kReceive ? Receiving::kReport : Receiving::kNothing;
    return answer;
  }
  return ControlAnswer::stall();
}

ControlAnswer UsbDevice::dfu_request(std::span<const std::byte> data) noexcept {
  using Code = DfuRequestCode;
  const auto code = static_cast<Code>(request_.request);
  const bool to_host = code == Code::kUpload || code == Code::kGetStatus || code == Code::kGetState;
  const bool well_formed = request_.type == (to_host ? kClassFromInterface : kClassToInterface) &&
                           (to_host || code == Code::kDnload || request_.length == 0);
  DfuRequest request{.request = well_formed ? request_.request : kNoDfuRequest,
                     .value = request_.value,
                     .index = usb::kDfuInterface,
                     .length = request_.length,
                     .data = data};
  if (code == Code::kDetach) {
    // The host's time is for its reset; this device leaves by itself (bitWillDetach).
    request.value = kDfuDetachTimeoutMs;
  }
  const DfuReply reply = parts_.dfu.request(request);
  if (reply.stall) {
    return ControlAnswer::stall();
  }
  if (reply.detach) {
    leaving_ = true;
    leave_at_us_ = parts_.clock.now_us() + kStatusStageUs;
  }
  if (!to_host) {
    return ControlAnswer::accept();
  }
  std::copy_n(reply.bytes.begin(), reply.size, buffer_.begin());
  return {.kind = ControlAnswer::Kind::kSend, .data = std::span(buffer_).first(reply.size)};
}

ControlAnswer UsbDevice::vendor_request() noexcept {
  if (request_.type != kVendorFromDevice || request_.request != usb_descriptors::kMicrosoftVendorCode ||
      request_.value != 0 || request_.index != usb_descriptors::kMicrosoftSetIndex) {
    return ControlAnswer::stall();
  }
  return ControlAnswer::send(usb_descriptors::microsoft_set(mode_));
}

}  // namespace scatter::firmware
