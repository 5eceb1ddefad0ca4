// One open /dev/bus/usb/BBB/DDD: its claims and transfers, as usbfs keeps them.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <set>
#include <vector>

#include "tests/usb/mock_bus/caller.h"
#include "tests/usb/mock_bus/host_port.h"

namespace scatter::mock_bus {

/// A transfer handed in by SUBMITURB.
struct Urb {
  std::uint64_t address = 0;  ///< Of the program's struct usbdevfs_urb.
  std::uint64_t buffer = 0;   ///< Where received bytes go.
  std::uint8_t endpoint = 0;
  std::size_t size = 0;  ///< Of the buffer: counts against usbfs memory.
  int status = 0;
  std::size_t actual = 0;
  Bytes data;  ///< Received.
};

struct UsbfsFile {
  Caller* caller = nullptr;
  std::set<std::uint8_t> claimed;
  std::map<std::uint64_t, Urb> under_way;  ///< By the host port's id.
  std::deque<Urb> done;
  unsigned after_gone = 0;  ///< Transfers handed in after the program was told that the device is gone.
  bool told_gone = false;
  bool waiting = false;  ///< A call that is answered later.
};

/// Bytes of usbfs memory that a file's transfers hold until they are reaped.
[[nodiscard]] std::size_t memory_of(const UsbfsFile& file);

}  // namespace scatter::mock_bus
