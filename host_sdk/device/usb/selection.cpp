#include "host_sdk/device/usb/selection.h"

#include <algorithm>

namespace scatter::device::usb {
namespace {

bool matches(const BusEntry& entry, const Selector& wanted) {
  return (wanted.serial.empty() || entry.serial == wanted.serial) &&
         (wanted.port.empty() || entry.port == wanted.port);
}

bool can_stream(const BusEntry& entry) {
  return entry.ours && !entry.dfu_mode;
}

std::string list(std::span<const BusEntry> entries) {
  std::string out;
  for (const BusEntry& entry : entries) {
    if (can_stream(entry)) {
      out += (out.empty() ? "" : ", ") + uri_for(entry);
    }
  }
  return out.empty() ? "none" : out;
}

std::string described(const Selector& wanted) {
  if (!wanted.serial.empty()) {
    return "instrument '" + wanted.serial + "'";
  }
  return wanted.port.empty() ? std::string("instrument") : "instrument at USB port " + wanted.port;
}

std::unexpected<Error> unusable(const BusEntry& entry) {
  const std::string device =
      (entry.product.empty() ? std::string("the device") : "the device '" + entry.product + "'") +
      " at USB port " + entry.port;
  if (!entry.readable) {
    return fail(ErrorCode::kFailedPrecondition,
                device + " has an instrument's numbers, but its descriptors cannot be read",
                "unplug it and plug it in again, without a hub and with another cable");
  }
  if (entry.dfu_mode) {
    return fail(ErrorCode::kFailedPrecondition, label(entry) + " waits for firmware (DFU mode)",
                "send it a release: dfu-util -D IMAGE.dfu; or unplug it and plug it in again");
  }
  return fail(ErrorCode::kFailedPrecondition,
              device + " has an instrument's numbers but not its interfaces: it is something else",
              "unplug it, or name your instrument by its serial number");
}

}  // namespace

Result<Selector> read_selector(const Uri& uri) {
  const std::string& text = uri.place.empty() ? uri.query : uri.place;
  const auto bad = [&](const std::string& why) {
    return fail(ErrorCode::kInvalidArgument, uri.text() + ": " + why,
                "write usb:, usb:serial=SC42 or usb:port=1-1.4");
  };
  if (!uri.place.empty() && !uri.query.empty()) {
    return bad("nothing may follow the '?'");
  }
  if (text.empty()) {
    return Selector{};
  }
  const std::size_t equals = text.find('=');
  const std::string key = text.substr(0, equals);
  if (equals == std::string::npos || (key != "serial" && key != "port")) {
    return bad("there is no key '" + key + "'");
  }
  const std::string value = text.substr(equals + 1);
  if (value.empty()) {
    return bad(key + " is empty");
  }
  return key == "serial" ? Selector{.serial = value, .port = {}} : Selector{.serial = {}, .port = value};
}

std::string uri_for(const BusEntry& entry) {
  return entry.serial.empty() ? "usb:port=" + entry.port : "usb:serial=" + entry.serial;
}

std::string label(const BusEntry& entry) {
  return (entry.serial.empty() ? std::string("the instrument") : "instrument '" + entry.serial + "'") +
         " at USB port " + entry.port;
}

Result<BusEntry> select(std::span<const BusEntry> entries, const Selector& wanted) {
  std::vector<const BusEntry*> able;
  const BusEntry* unable = nullptr;
  for (const BusEntry& entry : entries) {
    if (!matches(entry, wanted)) {
      continue;
    }
    if (can_stream(entry)) {
      able.push_back(&entry);
    } else if (unable == nullptr || entry.dfu_mode) {
      unable = &entry;
    }
  }
  if (able.empty() && unable != nullptr) {
    return unusable(*unable);
  }
  if (able.empty()) {
    const std::string there = list(entries);
    return fail(ErrorCode::kNotFound, "no " + described(wanted) + " is plugged in; there are: " + there,
                there == "none" ? "plug it in and switch it on; scatter doctor looks for the cause"
                                : "name one of those; scatter list shows them");
  }
  if (able.size() > 1) {
    const bool by_serial = !wanted.serial.empty();
    std::string ports;
    for (const BusEntry* entry : able) {
      ports += (ports.empty() ? "usb:port=" : ", usb:port=") + entry->port;
    }
    return fail(ErrorCode::kInvalidArgument,
                by_serial ? "several instruments have the serial number '" + wanted.serial + "': " + ports
                          : "several instruments are plugged in: " + list(entries),
                by_serial ? "name one by its port" : "name one of those");
  }
  return *able.front();
}

bool same_stay(const BusEntry& a, const BusEntry& b) {
  return a.port == b.port && a.bus == b.bus && a.address == b.address && a.serial == b.serial &&
         a.dfu_mode == b.dfu_mode;
}

std::vector<BusEntry> missing_in(const std::vector<BusEntry>& before, const std::vector<BusEntry>& now) {
  std::vector<BusEntry> out;
  for (const BusEntry& entry : now) {
    if (std::ranges::none_of(before, [&](const BusEntry& other) { return same_stay(entry, other); })) {
      out.push_back(entry);
    }
  }
  return out;
}

Error busy_error(const BusEntry& entry, std::span<const Holder> holders, int own_process) {
  std::string others;
  bool own = false;
  for (const Holder& one : holders) {
    if (one.process_id == own_process) {
      own = one.files > 1;
    } else {
      others += (others.empty() ? "" : ", ") + one.program + " (" + std::to_string(one.process_id) + ")";
    }
  }
  if (own && others.empty()) {
    return {ErrorCode::kBusy, label(entry) + ": this program has it open already",
            "go on with the Device that is open, or destroy it first"};
  }
  return {ErrorCode::kBusy,
          label(entry) + " is in use by " + (others.empty() ? std::string("another program") : others) +
              (own ? "; this program has it open, too" : ""),
          "close that program, or wait for it"};
}

}  // namespace scatter::device::usb
