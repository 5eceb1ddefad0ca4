// What the instrument says of itself on the bus, as it goes over the wire (SPEC.md section 11).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include "firmware/ports/usb_controller.h"

namespace scatter::firmware {

/// Who is on the bus. UTF-8, at most 126 UTF-16 units each, the rest is cut; the views outlive the device.
struct UsbIdentity {
  std::string_view manufacturer;   ///< Empty = none.
  std::string_view product;        ///< Empty = none.
  std::string_view serial;         ///< Unique; empty = none. For Windows: 0x20..0x7E without comma.
  std::uint16_t release_bcd = 0;   ///< bcdDevice: 0x0123 is 1.2.3.
  bool high_speed_capable = true;  ///< Of the controller; else there is no device qualifier.
};

/// Which set of descriptors is shown.
enum class UsbMode : std::uint8_t { kRunTime, kDfu };

namespace usb_descriptors {

enum class Type : std::uint8_t {
  kDevice = 1,
  kConfiguration = 2,
  kString = 3,
  kInterface = 4,
  kEndpoint = 5,
  kDeviceQualifier = 6,
  kOtherSpeedConfiguration = 7,
  kBos = 15,
  kDeviceCapability = 16,
  kHid = 0x21,
  kHidReport = 0x22,
};

/// bConfigurationValue of the only configuration.
inline constexpr std::uint8_t kConfiguration = 1;
inline constexpr std::uint8_t kStreamSettings = 2;  ///< Alternate settings of interface 0 at run time.
/// bRequest of the request for the Microsoft OS 2.0 descriptor set, named in the BOS; its wIndex.
inline constexpr std::uint8_t kMicrosoftVendorCode = 0x4D;
inline constexpr std::uint16_t kMicrosoftSetIndex = 7;

/// Longest of the two below [B].
inline constexpr std::size_t kMostBytes = 254;
using Buffer = std::array<std::byte, kMostBytes>;

/// Device descriptor; a view of `buffer`.
[[nodiscard]] std::span<const std::byte> device(Buffer& buffer, UsbMode mode,
                                                const UsbIdentity& identity) noexcept;
/// String `index` in US English (the only language), 0 = the list of languages; a view of `buffer`, empty
/// when there is no such string.
[[nodiscard]] std::span<const std::byte> string(Buffer& buffer, std::uint8_t index,
                                                const UsbIdentity& identity) noexcept;

/// Configuration with all that belongs to it, as it is at `speed`; as other-speed configuration where
/// `type` says so.
[[nodiscard]] std::span<const std::byte> configuration(UsbMode mode, UsbSpeed speed, Type type) noexcept;
[[nodiscard]] std::span<const std::byte> device_qualifier() noexcept;
/// USB 2.0 extension (no link power management) and the Microsoft OS 2.0 platform capability.
[[nodiscard]] std::span<const std::byte> bos(UsbMode mode) noexcept;
/// WinUSB for interface 0 and the DFU interface, so that Windows asks for no driver.
[[nodiscard]] std::span<const std::byte> microsoft_set(UsbMode mode) noexcept;
[[nodiscard]] std::span<const std::byte> hid() noexcept;
[[nodiscard]] std::span<const std::byte> hid_report() noexcept;

}  // namespace usb_descriptors
}  // namespace scatter::firmware
