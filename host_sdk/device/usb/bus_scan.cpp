#include "host_sdk/device/usb/bus_scan.h"

#include <sys/stat.h>

#include <algorithm>
#include <array>
#include <cstdio>

#include "host_sdk/device/usb/system_tables.h"
#include "host_sdk/device/usb/usb_shape.h"
#include "protocol/usb_identity.h"

namespace scatter::device::usb {
namespace {

using protocol::usb::kDfuProductId;
using protocol::usb::kProductId;
using protocol::usb::kVendorId;

namespace fs = std::filesystem;

// A device has at most 8 configurations of 64 KiB; ours has one of some hundred bytes.
constexpr std::size_t kMostDescriptorBytes = 64UL * 1024;

/// "1-1.4": a device in a socket. Root hubs are "usb1", interfaces "1-1.4:1.0".
bool names_a_device(std::string_view name) {
  return !name.empty() && name.front() >= '0' && name.front() <= '9' &&
         name.find(':') == std::string_view::npos;
}

std::uint32_t speed_of(std::string_view text) {
  return number(text.substr(0, text.find('.')), 10).value_or(0);  // "1.5" is the slowest.
}

/// "/dev/hidraw3" for each node below an interface.
void find_hidraw(const fs::path& interface, std::vector<fs::path>& out) {
  for (const std::string& child : names_in(interface)) {
    for (const std::string& node : names_in(interface / child / "hidraw")) {
      if (node.starts_with("hidraw")) {
        out.emplace_back("/dev/" + node);
      }
    }
  }
}

void read_interfaces(const fs::path& devices, const std::string& port, BusEntry& entry) {
  for (const std::string& name : names_in(devices)) {
    if (!name.starts_with(port + ":")) {
      continue;
    }
    const fs::path folder = devices / name;
    const auto which = number(attribute(folder / "bInterfaceNumber"), 16);
    if (which == protocol::usb::kStreamInterface) {
      const fs::path driver = link_target(folder / "driver");
      entry.stream_driver = driver.filename().string();
    }
    find_hidraw(folder, entry.hidraw);
  }
  entry.in_use = entry.stream_driver == "usbfs";
}

/// The same file, whatever it is called where it was opened.
bool same_file(const fs::path& a, const fs::path& b) {
  struct stat first{};
  struct stat second{};
  return ::stat(a.c_str(), &first) == 0 && ::stat(b.c_str(), &second) == 0 && first.st_dev == second.st_dev &&
         first.st_ino == second.st_ino;
}

}  // namespace

fs::path BusEntry::node() const {
  std::array<char, 32> text;
  (void)std::snprintf(text.data(), text.size(), "/dev/bus/usb/%03u/%03u", unsigned{bus}, unsigned{address});
  return text.data();
}

std::vector<Holder> find_holders(const fs::path& node, const SystemRoot& root) {
  std::vector<Holder> out;
  const fs::path processes = root.path / "proc";
  for (const std::string& name : names_in(processes)) {
    const auto process = number(name, 10);
    if (!process) {
      continue;
    }
    const fs::path files = processes / name / "fd";
    const std::vector<std::string> open = names_in(files);
    const auto is_node = [&](const std::string& one) {
      const std::string target = link_target(files / one);
      return target == node || (target.starts_with("/dev/") && same_file(files / one, node));
    };
    if (const auto times = std::ranges::count_if(open, is_node); times > 0) {
      out.push_back({.process_id = static_cast<int>(*process),
                     .program = attribute(processes / name / "comm"),
                     .files = static_cast<int>(times)});
    }
  }
  return out;
}

std::vector<BusEntry> scan_bus(const SystemRoot& root) {
  std::vector<BusEntry> out;
  const fs::path devices = root.path / "sys/bus/usb/devices";
  for (const std::string& port : names_in(devices)) {
    if (!names_a_device(port)) {
      continue;
    }
    const fs::path folder = devices / port;
    const std::optional<UsbShape> shape =
        read_shape(file_bytes(folder / "descriptors", kMostDescriptorBytes));
    const auto vendor = number(attribute(folder / "idVendor"), 16);
    const auto product = number(attribute(folder / "idProduct"), 16);
    const std::uint32_t vendor_id = vendor.value_or(shape ? shape->vendor_id : 0);
    const std::uint32_t product_id = product.value_or(shape ? shape->product_id : 0);
    if (vendor_id != kVendorId || (product_id != kProductId && product_id != kDfuProductId)) {
      continue;
    }
    const std::uint32_t bus = number(attribute(folder / "busnum"), 10).value_or(0);
    const std::uint32_t address = number(attribute(folder / "devnum"), 10).value_or(0);
    if (bus == 0 || bus > 255 || address == 0 || address > 127) {
      continue;  // It is just leaving or arriving.
    }
    BusEntry entry;
    entry.port = port;
    entry.bus = static_cast<std::uint8_t>(bus);
    entry.address = static_cast<std::uint8_t>(address);
    entry.product_id = static_cast<std::uint16_t>(product_id);
    entry.release = static_cast<std::uint16_t>(
        number(attribute(folder / "bcdDevice"), 16).value_or(shape ? shape->release : 0));
    entry.product = attribute(folder / "product");
    entry.serial = attribute(folder / "serial");
    entry.speed_mbps = speed_of(attribute(folder / "speed"));
    if (shape) {
      entry.readable = true;
      entry.dfu_mode = product_id == kDfuProductId && shape->dfu_mode();
      entry.ours = entry.dfu_mode || (product_id == kProductId && shape->streams());
      entry.rescue_interface = shape->has_hid();
    }
    read_interfaces(devices, port, entry);
    if (entry.in_use) {
      entry.holders = find_holders(entry.node(), root);
    }
    out.push_back(std::move(entry));
  }
  return out;
}

}  // namespace scatter::device::usb
