// Which device a usb: URI means, among those on the bus. Internal to this folder.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "host_sdk/device/uri.h"
#include "host_sdk/device/usb/bus_scan.h"
#include "host_sdk/error/error.h"

namespace scatter::device::usb {

/// At most one of them; none: the only instrument there is.
struct Selector {
  std::string serial;
  std::string port;
};

/// `usb:`, `usb:serial=SC42`, `usb:port=1-1.4`. Errors  kInvalidArgument: another key, an empty value.
[[nodiscard]] Result<Selector> read_selector(const Uri& uri);

/// "usb:serial=SC42", or by its port when it has no serial number.
[[nodiscard]] std::string uri_for(const BusEntry& entry);
/// "instrument 'SC42' at USB port 1-1.4"
[[nodiscard]] std::string label(const BusEntry& entry);

/// The entry that can be opened. Strangers and devices in DFU mode are passed over unless they are named, or
/// nothing else is there: then the error says what they are.
/// Errors  kNotFound, kInvalidArgument, kFailedPrecondition as Context::open.
[[nodiscard]] Result<BusEntry> select(std::span<const BusEntry> entries, const Selector& wanted);

/// The same device, without having left in between: at the same socket and address, in the same mode.
[[nodiscard]] bool same_stay(const BusEntry& a, const BusEntry& b);
/// Devices that `now` has and `before` has not; the same device in another address has been replugged.
[[nodiscard]] std::vector<BusEntry> missing_in(const std::vector<BusEntry>& before,
                                               const std::vector<BusEntry>& now);

/// The stream interface is claimed. `holders` were found while the caller (process `own_process`) had the
/// node open itself, which is not counted: its own name appears only where another Device of its has the node
/// open.
[[nodiscard]] Error busy_error(const BusEntry& entry, std::span<const Holder> holders, int own_process);

}  // namespace scatter::device::usb
