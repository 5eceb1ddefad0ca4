#include "tests/unit/device_usb_diagnosis/made_up_system.h"

#include <stdlib.h>

#include <cstdint>
#include <fstream>
#include <vector>

#include "host_sdk/device/usb/udev_rule.h"

namespace fs = std::filesystem;

namespace {

const fs::path kDevices = "sys/devices/pci0000:00/0000:00:14.0/usb1";

std::string padded(int number) {
  const std::string text = std::to_string(number);
  return std::string(3 - text.size(), '0') + text;
}

using Bytes = std::vector<std::uint8_t>;

std::uint8_t hex(const std::string& text, std::size_t from = 0) {
  return static_cast<std::uint8_t>(std::stoul(text.substr(from, 2), nullptr, 16));
}

Bytes interface_bytes(std::uint8_t number, std::uint8_t setting, std::uint8_t endpoints, const Bytes& kind) {
  return {9, 4, number, setting, endpoints, kind[0], kind[1], kind[2], 0};
}

Bytes endpoint_bytes(std::uint8_t address, std::uint8_t attributes, std::uint16_t packet) {
  return {7, 5, address, attributes, std::uint8_t(packet & 0xff), std::uint8_t(packet >> 8), 1};
}

/// Device and configuration as the device gives them: USB 2.0 section 9.6, SPEC.md section 11.
std::string descriptors(const MadeUpDevice& device) {
  const Bytes id = {hex(device.product_id, 2), hex(device.product_id)};
  Bytes all = {
      18, 1, 0x10, 0x02, 0, 0, 0, 64, 0x09, 0x12, id[0], id[1], hex(device.release, 2), hex(device.release),
      1,  2, 3,    1};
  Bytes rest;
  const auto add = [&](const Bytes& bytes) { rest.insert(rest.end(), bytes.begin(), bytes.end()); };
  const bool dfu = device.product_id == "000e";
  if (dfu) {
    add(interface_bytes(0, 0, 0, {0xfe, 1, 2}));
  } else {
    const Bytes stream = {hex(device.stream_class), hex(device.stream_subclass), 1};
    add(interface_bytes(0, 0, 0, stream));
    add(interface_bytes(0, 1, 2, stream));
    add(endpoint_bytes(0x81, 2, 512));
    add(endpoint_bytes(0x02, 2, 512));
    if (device.hid) {
      add(interface_bytes(1, 0, 2, {3, 0, 0}));
      add(endpoint_bytes(0x83, 3, 64));
      add(endpoint_bytes(0x04, 3, 64));
    }
    add(interface_bytes(2, 0, 0, {0xfe, 1, 1}));
  }
  const auto total = static_cast<std::uint16_t>(rest.size() + 9);
  const Bytes configuration = {
      9, 2, std::uint8_t(total & 0xff), std::uint8_t(total >> 8), std::uint8_t(dfu ? 1 : 3), 1, 0, 0x80, 250};
  all.insert(all.end(), configuration.begin(), configuration.end());
  all.insert(all.end(), rest.begin(), rest.end());
  return {all.begin(), all.end()};
}

fs::path node_of(const MadeUpDevice& device) {
  return fs::path("dev/bus/usb") / padded(device.bus) / padded(device.address);
}

}  // namespace

MadeUpSystem::MadeUpSystem() {
  std::string name = (fs::temp_directory_path() / "scatter-system-XXXXXX").string();
  folder_ = mkdtemp(name.data());
  fs::create_directories(folder_ / "sys/bus/usb/devices");
  fs::create_directories(folder_ / "dev/bus/usb/001");
  fs::create_directories(folder_ / "sys/devices/platform/vhci_hcd.0");
  write("run/udev/control", "");
  write("sys/module/usbcore/parameters/usbfs_memory_mb", "16\n");
  write("usr/lib/udev/rules.d/60-openscatter.rules", std::string(scatter::device::usb::udev_rule()));
}

MadeUpSystem::~MadeUpSystem() {
  std::error_code error;
  fs::remove_all(folder_, error);
}

void MadeUpSystem::write(const fs::path& file, const std::string& content) {
  fs::create_directories((folder_ / file).parent_path());
  std::ofstream(folder_ / file, std::ios::binary) << content;
}

void MadeUpSystem::remove(const fs::path& path) {
  fs::remove_all(folder_ / path);
}

void MadeUpSystem::link(const fs::path& target, const fs::path& name) {
  fs::create_directories((folder_ / name).parent_path());
  fs::remove(folder_ / name);
  fs::create_symlink(target, folder_ / name);
}

void MadeUpSystem::plug_in(const MadeUpDevice& device) {
  const fs::path home = kDevices / device.port;
  const bool dfu = device.product_id == "000e";
  write(home / "idVendor", "1209\n");
  write(home / "idProduct", device.product_id + "\n");
  write(home / "busnum", std::to_string(device.bus) + "\n");
  write(home / "devnum", std::to_string(device.address) + "\n");
  write(home / "bcdDevice", device.release + "\n");
  write(home / "speed", device.speed + "\n");
  write(home / "bConfigurationValue", "1\n");
  write(home / "bNumInterfaces", dfu ? " 1\n" : " 3\n");
  write(home / "descriptors", descriptors(device));
  if (!device.product.empty()) {
    write(home / "product", device.product + "\n");
  }
  if (!device.serial.empty()) {
    write(home / "serial", device.serial + "\n");
  }
  link("../../../../../../bus/usb", home / "subsystem");
  link(fs::path("../../../devices/pci0000:00/0000:00:14.0/usb1") / device.port,
       fs::path("sys/bus/usb/devices") / device.port);
  const auto interface = [&](int number, const std::string& cls, const std::string& subclass,
                             const std::string& protocol, const std::string& driver) {
    const std::string name = device.port + ":1." + std::to_string(number);
    const fs::path folder = home / name;
    write(folder / "bInterfaceNumber", padded(number).substr(1) + "\n");
    write(folder / "bAlternateSetting", " 0\n");
    write(folder / "bInterfaceClass", cls + "\n");
    write(folder / "bInterfaceSubClass", subclass + "\n");
    write(folder / "bInterfaceProtocol", protocol + "\n");
    if (!driver.empty()) {
      fs::create_directories(folder_ / "sys/bus/usb/drivers" / driver);
      link(fs::path("../../../../../../../bus/usb/drivers") / driver, folder / "driver");
    }
    link(fs::path("../../../devices/pci0000:00/0000:00:14.0/usb1") / device.port / name,
         fs::path("sys/bus/usb/devices") / name);
    return folder;
  };
  if (dfu) {
    interface(0, "fe", "01", "02", "");
  } else {
    interface(0, device.stream_class, device.stream_subclass, "01", device.stream_driver);
    if (device.hid) {
      const fs::path folder = interface(1, "03", "00", "00", device.hidraw ? "usbhid" : "");
      if (device.hidraw) {
        write(folder / "0003:1209:000D.0001/hidraw/hidraw0/dev", "241:0\n");
        write("dev/hidraw0", "");
      }
    }
    interface(2, "fe", "01", "01", "");
  }
  write(node_of(device), "");
}

void MadeUpSystem::hold(const MadeUpDevice& device, int process_id, const std::string& program) {
  const fs::path process = fs::path("proc") / std::to_string(process_id);
  write(process / "comm", program + "\n");
  link(fs::path("/") / node_of(device), process / "fd/7");
  fs::create_directories(folder_ / "sys/bus/usb/drivers/usbfs");
  link("../../../../../../../bus/usb/drivers/usbfs",
       kDevices / device.port / (device.port + ":1.0") / "driver");
}
