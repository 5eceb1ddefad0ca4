// What a device says of itself in its descriptors, and whether that is an instrument. Internal to this
// folder.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace scatter::device::usb {

struct UsbEndpointShape {
  std::uint8_t address = 0;  ///< Bit 7: to the host.
  std::uint8_t kind = 0;     ///< 0 control, 1 isochronous, 2 bulk, 3 interrupt.
};

/// One alternate setting of an interface.
struct UsbInterfaceShape {
  std::uint8_t number = 0;
  std::uint8_t setting = 0;
  std::uint8_t interface_class = 0;
  std::uint8_t sub_class = 0;
  std::uint8_t protocol = 0;
  std::vector<UsbEndpointShape> endpoints;
};

struct UsbShape {
  std::uint16_t vendor_id = 0;
  std::uint16_t product_id = 0;
  std::uint16_t release = 0;
  std::vector<UsbInterfaceShape> interfaces;  ///< Of the first configuration.

  /// Carries frames: interface 0 is of our class and has both bulk endpoints in its open setting.
  [[nodiscard]] bool streams() const noexcept;
  /// Waits for firmware: interface 0 is DFU's.
  [[nodiscard]] bool dfu_mode() const noexcept;
  [[nodiscard]] bool has_hid() const noexcept;
};

/// Reads a device descriptor with its configurations, as the system gives them. Total: nothing when lengths
/// do not fit together, or a part is missing.
[[nodiscard]] std::optional<UsbShape> read_shape(std::span<const std::byte> descriptors);

}  // namespace scatter::device::usb
