#include "host_sdk/device/usb/usb_shape.h"

#include <algorithm>

#include "protocol/usb_identity.h"

namespace scatter::device::usb {
namespace {

using protocol::usb::kBulkIn;
using protocol::usb::kBulkOut;
using protocol::usb::kStreamClass;
using protocol::usb::kStreamInterface;
using protocol::usb::kStreamOpenSetting;
using protocol::usb::kStreamSubClass;

// USB 2.0 section 9.6.
constexpr std::uint8_t kDeviceDescriptor = 1;
constexpr std::uint8_t kConfigurationDescriptor = 2;
constexpr std::uint8_t kInterfaceDescriptor = 4;
constexpr std::uint8_t kEndpointDescriptor = 5;
constexpr std::size_t kDeviceBytes = 18;
constexpr std::size_t kConfigurationBytes = 9;
constexpr std::size_t kInterfaceBytes = 9;
constexpr std::size_t kEndpointBytes = 7;

constexpr std::uint8_t kHidClass = 0x03;
constexpr std::uint8_t kApplicationClass = 0xFE;
constexpr std::uint8_t kDfuSubClass = 0x01;
constexpr std::uint8_t kDfuModeProtocol = 0x02;
constexpr std::uint8_t kBulk = 2;

std::uint8_t at(std::span<const std::byte> bytes, std::size_t index) {
  return static_cast<std::uint8_t>(bytes[index]);
}

std::uint16_t word_at(std::span<const std::byte> bytes, std::size_t index) {
  return static_cast<std::uint16_t>(at(bytes, index) | at(bytes, index + 1) << 8U);
}

}  // namespace

bool UsbShape::streams() const noexcept {
  return std::ranges::any_of(interfaces, [](const UsbInterfaceShape& one) {
    const auto has = [&](std::uint8_t address) {
      return std::ranges::any_of(one.endpoints, [&](const UsbEndpointShape& endpoint) {
        return endpoint.address == address && endpoint.kind == kBulk;
      });
    };
    return one.number == kStreamInterface && one.setting == kStreamOpenSetting &&
           one.interface_class == kStreamClass && one.sub_class == kStreamSubClass && has(kBulkIn) &&
           has(kBulkOut);
  });
}

bool UsbShape::dfu_mode() const noexcept {
  return std::ranges::any_of(interfaces, [](const UsbInterfaceShape& one) {
    return one.number == protocol::usb::kDfuModeInterface && one.interface_class == kApplicationClass &&
           one.sub_class == kDfuSubClass && one.protocol == kDfuModeProtocol;
  });
}

bool UsbShape::has_hid() const noexcept {
  return std::ranges::any_of(interfaces,
                             [](const UsbInterfaceShape& one) { return one.interface_class == kHidClass; });
}

std::optional<UsbShape> read_shape(std::span<const std::byte> descriptors) {
  if (descriptors.size() < kDeviceBytes || at(descriptors, 0) < kDeviceBytes ||
      at(descriptors, 0) > descriptors.size() || at(descriptors, 1) != kDeviceDescriptor) {
    return std::nullopt;
  }
  UsbShape out;
  out.vendor_id = word_at(descriptors, 8);
  out.product_id = word_at(descriptors, 10);
  out.release = word_at(descriptors, 12);
  std::span<const std::byte> rest = descriptors.subspan(at(descriptors, 0));
  if (rest.size() < kConfigurationBytes || at(rest, 0) < kConfigurationBytes ||
      at(rest, 1) != kConfigurationDescriptor || word_at(rest, 2) > rest.size()) {
    return std::nullopt;
  }
  rest = rest.first(word_at(rest, 2));
  while (!rest.empty()) {
    const std::size_t length = at(rest, 0);
    if (rest.size() < 2 || length < 2 || length > rest.size()) {
      return std::nullopt;
    }
    const std::uint8_t kind = at(rest, 1);
    if (kind == kInterfaceDescriptor) {
      if (length < kInterfaceBytes) {
        return std::nullopt;
      }
      out.interfaces.push_back({.number = at(rest, 2),
                                .setting = at(rest, 3),
                                .interface_class = at(rest, 5),
                                .sub_class = at(rest, 6),
                                .protocol = at(rest, 7),
                                .endpoints = {}});
    } else if (kind == kEndpointDescriptor) {
      if (length < kEndpointBytes || out.interfaces.empty()) {
        return std::nullopt;
      }
      out.interfaces.back().endpoints.push_back(
          {.address = at(rest, 2), .kind = static_cast<std::uint8_t>(at(rest, 3) & 3U)});
    }
    rest = rest.subspan(length);
  }
  return out;
}

}  // namespace scatter::device::usb
