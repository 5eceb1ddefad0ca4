// What both ends of a USB cable agree on (SPEC.md section 11): identifiers, interfaces, endpoints, sizes.
#pragma once

#include <cstddef>
#include <cstdint>

#include "protocol/frame.h"
#include "protocol/messages.h"

namespace scatter::protocol::usb {

/// pid.codes; the product numbers are from its range for tests (0x0001..0x0010) until one is assigned, so
/// that a foreign device may carry the same: look at the interface's class numbers before believing it is
/// ours.
inline constexpr std::uint16_t kVendorId = 0x1209;
inline constexpr std::uint16_t kProductId = 0x000D;
/// In DFU mode. A number of its own, because Windows remembers the descriptors of a vendor, product and
/// release.
inline constexpr std::uint16_t kDfuProductId = 0x000E;

/// Interface 0: frames, as in section 2. Alternate setting 0 has no endpoints: nobody is attached. A host
/// selects alternate setting 1, which empties both pipes; the system selects 0 again when the host's program
/// ends, however it ends, and the device then ends run and session.
inline constexpr std::uint8_t kStreamInterface = 0;
inline constexpr std::uint8_t kStreamIdleSetting = 0;
inline constexpr std::uint8_t kStreamOpenSetting = 1;
inline constexpr std::uint8_t kStreamClass = 0xFF;
inline constexpr std::uint8_t kStreamSubClass =
    0x05;  ///< "Optical scatter": ours among vendor-specific ones.
inline constexpr std::uint8_t kStreamProtocol = kWireMajor;
inline constexpr std::uint8_t kBulkIn = 0x81;
inline constexpr std::uint8_t kBulkOut = 0x02;

/// Interface 1: HID, the rescue channel (rescue_report.h).
inline constexpr std::uint8_t kRescueInterface = 1;
inline constexpr std::uint16_t kRescueUsagePage = 0xFF00;
inline constexpr std::uint16_t kRescueUsage = 0x0001;
inline constexpr std::uint8_t kRescueIn = 0x83;
inline constexpr std::uint8_t kRescueOut = 0x04;
inline constexpr std::size_t kRescuePacket = 64;

/// Interface 2: DFU 1.1, run time. In DFU mode it is the only one and has number 0.
inline constexpr std::uint8_t kDfuInterface = 2;
inline constexpr std::uint8_t kDfuModeInterface = 0;

inline constexpr std::size_t kHighSpeedBulkPacket = 512;
inline constexpr std::size_t kFullSpeedBulkPacket = 64;
inline constexpr std::size_t kControlPacket = 64;

/// Each wire frame to the host ends a transfer (a short packet, or one of no bytes), so that it lies whole in
/// one buffer of this size and needs no copy to be put together. A hint only: receivers go by length and
/// checksum.
inline constexpr std::size_t kTransferBytes =
    (kMaxFrameBytes + kHighSpeedBulkPacket) / kHighSpeedBulkPacket * kHighSpeedBulkPacket;

}  // namespace scatter::protocol::usb
