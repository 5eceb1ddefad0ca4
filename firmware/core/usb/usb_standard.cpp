// Standard requests, USB 2.0 section 9.4. What the specification leaves unspecified is a stall, but for
// requests of the Address state in the Default state: carriers such as USB/IP never show SET_ADDRESS to the
// device.
#include <algorithm>

#include "firmware/core/usb/usb_device.h"
#include "protocol/usb_identity.h"

namespace scatter::firmware {
namespace {

namespace usb = protocol::usb;
using Type = usb_descriptors::Type;
using Recipient = ControlRequest::Recipient;

// Table 9-4.
enum StandardRequest : std::uint8_t {
  kGetStatus = 0,
  kClearFeature = 1,
  kSetFeature = 3,
  kSetAddress = 5,
  kGetDescriptor = 6,
  kGetConfiguration = 8,
  kSetConfiguration = 9,
  kGetInterface = 10,
  kSetInterface = 11,
};
constexpr std::uint16_t kEndpointHalt = 0;  // Table 9-6.
constexpr std::uint16_t kMaxAddress = 127;
constexpr std::uint16_t kUsEnglish = 0x0409;

constexpr std::uint8_t kToDevice = 0x00;
constexpr std::uint8_t kToInterface = 0x01;
constexpr std::uint8_t kToEndpoint = 0x02;
constexpr std::uint8_t kFromDevice = 0x80;
constexpr std::uint8_t kFromInterface = 0x81;
constexpr std::uint8_t kFromEndpoint = 0x82;

[[nodiscard]] bool is_control_endpoint(std::uint16_t index) noexcept {
  return index == 0x00 || index == 0x80;
}

}  // namespace

ControlAnswer UsbDevice::standard_request() noexcept {
  if (!request_.to_host() && request_.length != 0) {
    return ControlAnswer::stall();  // Only SET_DESCRIPTOR has data, and it is optional.
  }
  switch (request_.request) {
    case kGetStatus:
      return get_status();
    case kClearFeature:
      return change_feature(false);
    case kSetFeature:
      return change_feature(true);
    case kSetAddress:
      return set_address();
    case kGetDescriptor:
      return get_descriptor();
    case kGetConfiguration:
      return get_configuration();
    case kSetConfiguration:
      return set_configuration();
    case kGetInterface:
      return get_interface();
    case kSetInterface:
      return set_interface();
    default:
      return ControlAnswer::stall();
  }
}

bool UsbDevice::has_interface(std::uint16_t index) const noexcept {
  const std::uint16_t count = mode_ == UsbMode::kDfu ? 1 : 3;
  return configured() && index < count;
}

bool UsbDevice::has_endpoint(std::uint16_t index) const noexcept {
  if (!configured() || mode_ == UsbMode::kDfu) {
    return false;
  }
  const bool bulk = index == usb::kBulkIn || index == usb::kBulkOut;
  return index == usb::kRescueIn || index == usb::kRescueOut ||
         (bulk && stream_setting_ == usb::kStreamOpenSetting);
}

ControlAnswer UsbDevice::give(std::uint16_t value, std::size_t size) noexcept {
  buffer_[0] = static_cast<std::byte>(value & 0xFFU);
  buffer_[1] = static_cast<std::byte>(value >> 8U);
  return ControlAnswer::send(std::span(buffer_).first(size));
}

ControlAnswer UsbDevice::get_status() noexcept {
  if (request_.value != 0) {
    return ControlAnswer::stall();
  }
  switch (request_.type) {
    case kFromDevice:  // Neither self-powered nor able to wake the host.
      return request_.index == 0 ? give(0, 2) : ControlAnswer::stall();
    case kFromInterface:
      return has_interface(request_.index) ? give(0, 2) : ControlAnswer::stall();
    case kFromEndpoint:
      if (is_control_endpoint(request_.index)) {
        return give(0, 2);
      }
      if (!has_endpoint(request_.index)) {
        return ControlAnswer::stall();
      }
      return give(parts_.controller.halted(static_cast<std::uint8_t>(request_.index)) ? 1 : 0, 2);
    default:
      return ControlAnswer::stall();
  }
}

/// The only feature is ENDPOINT_HALT. Ending a halt that is not there resets the data toggle all the same
/// (9.4.5).
ControlAnswer UsbDevice::change_feature(bool set) noexcept {
  if (request_.type != kToEndpoint || request_.value != kEndpointHalt) {
    return ControlAnswer::stall();
  }
  if (is_control_endpoint(request_.index)) {  // It is never halted.
    return set ? ControlAnswer::stall() : ControlAnswer::accept();
  }
  if (!has_endpoint(request_.index)) {
    return ControlAnswer::stall();
  }
  parts_.controller.set_halt(static_cast<std::uint8_t>(request_.index), set);
  return ControlAnswer::accept();
}

ControlAnswer UsbDevice::set_address() noexcept {
  if (request_.type != kToDevice || request_.index != 0 || request_.value > kMaxAddress || configured()) {
    return ControlAnswer::stall();
  }
  parts_.controller.set_address(static_cast<std::uint8_t>(request_.value));
  return ControlAnswer::accept();
}

ControlAnswer UsbDevice::get_descriptor() noexcept {
  if (request_.type == kFromInterface) {
    return interface_descriptor();
  }
  if (request_.type != kFromDevice) {
    return ControlAnswer::stall();
  }
  const auto type = static_cast<Type>(request_.value >> 8U);
  const auto index = static_cast<std::uint8_t>(request_.value & 0xFFU);
  if (type == Type::kString) {
    const bool known = index == 0 || request_.index == kUsEnglish;
    return known ? ControlAnswer::send(usb_descriptors::string(buffer_, index, identity_))
                 : ControlAnswer::stall();
  }
  if (index != 0 || request_.index != 0) {
    return ControlAnswer::stall();
  }
  const bool high_speed = parts_.controller.speed() == UsbSpeed::kHigh;
  const UsbSpeed speed = high_speed ? UsbSpeed::kHigh : UsbSpeed::kFull;
  switch (type) {
    case Type::kDevice:
      return ControlAnswer::send(usb_descriptors::device(buffer_, mode_, identity_));
    case Type::kConfiguration:
      return ControlAnswer::send(usb_descriptors::configuration(mode_, speed, type));
    case Type::kBos:
      return ControlAnswer::send(usb_descriptors::bos(mode_));
    case Type::kDeviceQualifier:
      return identity_.high_speed_capable ? ControlAnswer::send(usb_descriptors::device_qualifier())
                                          : ControlAnswer::stall();
    case Type::kOtherSpeedConfiguration:
      return identity_.high_speed_capable ? ControlAnswer::send(usb_descriptors::configuration(
                                                mode_, high_speed ? UsbSpeed::kFull : UsbSpeed::kHigh, type))
                                          : ControlAnswer::stall();
    default:
      return ControlAnswer::stall();
  }
}

/// HID 1.11, section 7.1.1.
ControlAnswer UsbDevice::interface_descriptor() noexcept {
  if (mode_ == UsbMode::kDfu || !has_interface(request_.index) || request_.index != usb::kRescueInterface) {
    return ControlAnswer::stall();
  }
  switch (request_.value) {
    case static_cast<std::uint16_t>(Type::kHid) << 8U:
      return ControlAnswer::send(usb_descriptors::hid());
    case static_cast<std::uint16_t>(Type::kHidReport) << 8U:
      return ControlAnswer::send(usb_descriptors::hid_report());
    default:
      return ControlAnswer::stall();
  }
}

ControlAnswer UsbDevice::get_configuration() noexcept {
  const bool well_formed = request_.type == kFromDevice && request_.value == 0 && request_.index == 0;
  return well_formed ? give(configuration_, 1) : ControlAnswer::stall();
}

ControlAnswer UsbDevice::set_configuration() noexcept {
  if (request_.type != kToDevice || request_.index != 0 || request_.value > usb_descriptors::kConfiguration) {
    return ControlAnswer::stall();
  }
  parts_.link.close();
  parts_.controller.open_endpoints({});
  configuration_ = static_cast<std::uint8_t>(request_.value);
  stream_setting_ = usb::kStreamIdleSetting;
  open_endpoints();
  if (configured() && mode_ == UsbMode::kRunTime && rescue_) {
    rescue_->open();
  }
  return ControlAnswer::accept();
}

ControlAnswer UsbDevice::get_interface() noexcept {
  if (request_.type != kFromInterface || request_.value != 0 || !has_interface(request_.index)) {
    return ControlAnswer::stall();
  }
  const bool stream = mode_ == UsbMode::kRunTime && request_.index == usb::kStreamInterface;
  return give(stream ? stream_setting_ : 0, 1);
}

ControlAnswer UsbDevice::set_interface() noexcept {
  if (request_.type != kToInterface || !has_interface(request_.index)) {
    return ControlAnswer::stall();
  }
  const bool stream = mode_ == UsbMode::kRunTime && request_.index == usb::kStreamInterface;
  if (request_.value >= (stream ? usb_descriptors::kStreamSettings : 1)) {
    return ControlAnswer::stall();
  }
  // The endpoints of the interface begin anew, whatever the setting was (9.1.1.5); the others stay.
  if (stream) {
    parts_.link.close();
    stream_setting_ = usb::kStreamIdleSetting;
    open_endpoints();
    stream_setting_ = static_cast<std::uint8_t>(request_.value);
    if (stream_setting_ == usb::kStreamOpenSetting) {
      open_endpoints();
      parts_.link.open();
    }
  } else if (mode_ == UsbMode::kRunTime && request_.index == usb::kRescueInterface) {
    parts_.controller.set_halt(usb::kRescueIn, false);
    parts_.controller.set_halt(usb::kRescueOut, false);
  }
  return ControlAnswer::accept();
}

void UsbDevice::open_endpoints() noexcept {
  if (!configured() || mode_ == UsbMode::kDfu) {
    parts_.controller.open_endpoints({});
    return;
  }
  using Pipe = UsbEndpoint::Type;
  const bool high_speed = parts_.controller.speed() == UsbSpeed::kHigh;
  const auto bulk =
      static_cast<std::uint16_t>(high_speed ? usb::kHighSpeedBulkPacket : usb::kFullSpeedBulkPacket);
  const std::array<UsbEndpoint, 4> all{{{usb::kRescueIn, Pipe::kInterrupt, usb::kRescuePacket},
                                        {usb::kRescueOut, Pipe::kInterrupt, usb::kRescuePacket},
                                        {usb::kBulkIn, Pipe::kBulk, bulk},
                                        {usb::kBulkOut, Pipe::kBulk, bulk}}};
  const std::size_t count = stream_setting_ == usb::kStreamOpenSetting ? 4 : 2;
  parts_.controller.open_endpoints(std::span(all).first(count));
}

}  // namespace scatter::firmware
