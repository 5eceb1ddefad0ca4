// What is plugged in, read from the system's own tables: no device is opened or disturbed.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "host_sdk/error/error.h"

namespace scatter::device::usb {

/// A program that holds an interface of a device; only those that this user may see.
struct Holder {
  int process_id = 0;
  std::string program;  ///< "scatter"
  int files = 1;        ///< How often it has the node open.
};

/// One of our vendor's devices on the bus.
struct BusEntry {
  std::string port;      ///< The system's name for the socket: "1-1.4".
  std::uint8_t bus = 0;  ///< With `address`: the node /dev/bus/usb/BBB/DDD.
  std::uint8_t address = 0;
  std::uint16_t product_id = 0;
  std::uint16_t release = 0;  ///< bcdDevice.
  std::string product;        ///< "" when the device gives none.
  std::string serial;
  std::uint32_t speed_mbps = 0;  ///< 12, 480, 5000; 0: unknown.
  bool readable = false;         ///< Its descriptors are whole; false: `ours` and what follows is not known.
  bool ours = false;  ///< Its interfaces are those of an instrument, not of a stranger with our numbers.
  bool dfu_mode = false;
  bool rescue_interface = false;  ///< HID is there.
  bool in_use = false;            ///< A program has claimed the stream interface.
  std::vector<Holder> holders;
  std::string stream_driver;  ///< Kernel driver bound to interface 0, "" for none; "usbfs" is a program.
  std::vector<std::filesystem::path> hidraw;  ///< Nodes of the rescue interface.

  [[nodiscard]] std::filesystem::path node() const;
};

/// Where the system keeps its tables; tests name another root.
struct SystemRoot {
  std::filesystem::path path = "/";
};

/// Programs that have the node open, as far as this user may see; reads the list of open files of every
/// process.
[[nodiscard]] std::vector<Holder> find_holders(const std::filesystem::path& node,
                                               const SystemRoot& root = {});

/// Devices with our vendor and product numbers, by port. Empty where there is no USB.
/// A device without readable descriptors is listed as not ours. Bytes in names that would disturb a terminal
/// become '?'.
/// Cost  a few file reads per device, and find_holders() for one in use. Threads  any.
[[nodiscard]] std::vector<BusEntry> scan_bus(const SystemRoot& root = {});

}  // namespace scatter::device::usb
