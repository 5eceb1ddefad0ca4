// Can an instrument on the bus be used, by this user, now? Told without opening it.
#pragma once

#include <filesystem>
#include <functional>
#include <string>

#include "host_sdk/device/usb/bus_scan.h"

namespace scatter::device::usb {

enum class Availability {
  kFree,
  kInUse,         ///< Another program holds it.
  kNoPermission,  ///< This user may not open its node.
  kDfuMode,       ///< Waits for firmware.
  kNotOurs,       ///< A stranger's device with our numbers.
};

/// True when this process may read and write the file. Null in what takes one: asks the system.
using MayUse = std::function<bool(const std::filesystem::path&)>;

[[nodiscard]] Availability availability(const BusEntry& entry, const SystemRoot& root = {},
                                        const MayUse& may_use = nullptr);
/// "free", "in use", "no permission", "DFU mode", "not ours"
[[nodiscard]] const char* words(Availability availability) noexcept;

/// How to name it when opening: "usb:serial=SC42", or by its port without a serial number.
[[nodiscard]] std::string uri_of(const BusEntry& entry);
/// "scatter (1234)", several with commas; "another program" when the system does not say who.
[[nodiscard]] std::string holder_words(const BusEntry& entry);
/// bcdDevice 0x0123 as "1.2.3".
[[nodiscard]] std::string release_words(std::uint16_t release_bcd);
/// Below 480 Mb/s frames come slower than the sensor takes them.
[[nodiscard]] bool slow_bus(const BusEntry& entry) noexcept;

/// Path under another root.
[[nodiscard]] std::filesystem::path under(const SystemRoot& root, const std::filesystem::path& path);
/// Asks the system for this process's user.
[[nodiscard]] bool may_read_and_write(const std::filesystem::path& path);

}  // namespace scatter::device::usb
