#include "tests/usb/mock_bus/bus_device.h"

#include <poll.h>

#include <algorithm>
#include <cerrno>
#include <random>
#include <utility>

#include <fmt/format.h>

namespace scatter::mock_bus {

using simulator::UsbCompletion;
using simulator::UsbTransfer;

namespace {

std::string text_of(const Bytes& bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

}  // namespace

std::size_t memory_of(const UsbfsFile& file) {
  std::size_t bytes = 0;
  for (const auto& [id, urb] : file.under_way) {
    bytes += urb.size;
  }
  for (const Urb& urb : file.done) {
    bytes += urb.size;
  }
  return bytes;
}

BusDevice::BusDevice(Testbed& testbed, HostPort& host, Tally& tally, const BusConditions& conditions,
                     Enumerated enumerated, Place place)
    : testbed_(testbed),
      host_(host),
      tally_(tally),
      conditions_(conditions),
      enumerated_(std::move(enumerated)),
      place_(std::move(place)),
      server_(testbed.socket_of(fmt::format("dev/bus/usb/{:03}/{:03}", place_.bus, place_.address)), *this) {
  add_entries();
}

BusDevice::~BusDevice() {
  *alive_ = false;
}

void BusDevice::add_entries() {
  const Enumerated& known = enumerated_;
  entry_.path = fmt::format("/devices/mock/usb{}/{}", place_.bus, place_.port);
  entry_.subsystem = "usb";
  entry_.node = fmt::format("bus/usb/{:03}/{:03}", place_.bus, place_.address);
  entry_.properties = {
      {"DEVTYPE", "usb_device"},
      {"DRIVER", "usb"},
      {"PRODUCT", fmt::format("{:x}/{:x}/{:x}", known.vendor(), known.product_id(), known.release())},
      {"BUSNUM", fmt::format("{:03}", place_.bus)},
      {"DEVNUM", fmt::format("{:03}", place_.address)}};
  std::string descriptors = text_of(known.device) + text_of(known.configuration);
  if (conditions_.garble >= 0) {
    descriptors.resize(
        std::min<std::size_t>(descriptors.size(), static_cast<std::size_t>(conditions_.garble)));
  }
  if (conditions_.scramble != 0) {
    // The device descriptor stays, or it would not be known for one of ours.
    std::mt19937 random(conditions_.scramble);
    for (std::size_t k = 18; k < descriptors.size(); ++k) {
      descriptors[k] = static_cast<char>(random() & 0xFFU);
    }
  }
  entry_.attributes = {{"busnum", fmt::format("{}\n", place_.bus)},
                       {"devnum", fmt::format("{}\n", place_.address)},
                       {"devpath", place_.port.substr(place_.port.find('-') + 1) + "\n"},
                       {"idVendor", fmt::format("{:04x}\n", known.vendor())},
                       {"idProduct", fmt::format("{:04x}\n", known.product_id())},
                       {"bcdDevice", fmt::format("{:04x}\n", known.release())},
                       {"speed", fmt::format("{}\n", place_.speed_mbps)},
                       {"version", " 2.10\n"},
                       {"bConfigurationValue", "1\n"},
                       {"bNumConfigurations", "1\n"},
                       {"descriptors", descriptors}};
  for (const auto& [name, value] :
       {std::pair<const char*, const std::string*>{"manufacturer", &known.manufacturer},
        {"product", &known.product},
        {"serial", &known.serial}}) {
    if (!value->empty()) {
      entry_.attributes.emplace_back(name, *value + "\n");
    }
  }
  node_.set_access(conditions_.access);
  testbed_.add(entry_, &node_);
  // The kernel makes no interfaces of descriptors that it cannot read.
  const bool readable = conditions_.garble < 0 && conditions_.scramble == 0;
  for (const Enumerated::Interface& interface : known.interfaces) {
    if (readable && interface.setting == 0) {
      interface_entries_.push_back(interface_entry(interface));
      testbed_.add(interface_entries_.back());
    }
  }
  testbed_.announce(entry_, "add");
  for (const Enumerated::Interface& interface : known.interfaces) {
    if (readable && conditions_.hid_driver && interface.klass == 3) {
      bind_hid(interface.number, true);
    }
  }
}

SysDevice BusDevice::interface_entry(const Enumerated::Interface& interface) const {
  SysDevice entry;
  entry.path = fmt::format("{}/{}:1.{}", entry_.path, place_.port, interface.number);
  entry.subsystem = "usb";
  entry.properties = {
      {"DEVTYPE", "usb_interface"},
      {"PRODUCT",
       fmt::format("{:x}/{:x}/{:x}", enumerated_.vendor(), enumerated_.product_id(), enumerated_.release())},
      {"INTERFACE", fmt::format("{}/{}/{}", interface.klass, interface.subclass, interface.protocol)}};
  entry.attributes = {{"bInterfaceNumber", fmt::format("{:02x}\n", interface.number)},
                      {"bAlternateSetting", fmt::format("{:2}\n", interface.setting)},
                      {"bNumEndpoints", fmt::format("{:02x}\n", interface.endpoints.size())},
                      {"bInterfaceClass", fmt::format("{:02x}\n", interface.klass)},
                      {"bInterfaceSubClass", fmt::format("{:02x}\n", interface.subclass)},
                      {"bInterfaceProtocol", fmt::format("{:02x}\n", interface.protocol)}};
  return entry;
}

void BusDevice::set_driver(std::uint8_t interface, const Binding& driver) {
  interfaces_.at(interface).driver = driver;
  if (!gone_) {
    // "driver" links to a folder whose name is the driver's.
    testbed_.set_link(fmt::format("{}/{}:1.{}", entry_.path, place_.port, interface), "driver",
                      driver.empty() ? "" : "../../../../../bus/usb/drivers/" + driver);
  }
}

void BusDevice::bind_hid(std::uint8_t interface, bool announced) {
  const auto found = std::find_if(enumerated_.interfaces.begin(), enumerated_.interfaces.end(),
                                  [&](const auto& each) { return each.number == interface; });
  set_driver(interface, "usbhid");
  hidraw_ =
      std::make_unique<Hidraw>(testbed_, host_, tally_, enumerated_, *found,
                               Hidraw::Place{fmt::format("{}/{}:1.{}", entry_.path, place_.port, interface),
                                             testbed_.next_hidraw(), announced});
  hidraw_->set_access(conditions_.access);
}

void BusDevice::unbind_hid() {
  if (hidraw_ == nullptr) {
    return;
  }
  hidraw_->detach();
  old_hidraws_.push_back(std::move(hidraw_));
}

bool BusDevice::has_interface(std::uint8_t number) const {
  return std::any_of(enumerated_.interfaces.begin(), enumerated_.interfaces.end(),
                     [&](const auto& each) { return each.number == number; });
}

const Enumerated::Interface* BusDevice::interface_of(std::uint8_t endpoint) const {
  for (const Enumerated::Interface& interface : enumerated_.interfaces) {
    if (interface.setting == interfaces_.at(interface.number).setting &&
        std::find(interface.endpoints.begin(), interface.endpoints.end(), endpoint) !=
            interface.endpoints.end()) {
      return &interface;
    }
  }
  return nullptr;
}

void BusDevice::opened(Caller& caller) {
  ++tally_.opened;
  files_.emplace_back().caller = &caller;
}

void BusDevice::closed(Caller& caller) {
  const auto file = std::find_if(files_.begin(), files_.end(),
                                 [&](const UsbfsFile& each) { return each.caller == &caller; });
  if (file == files_.end()) {
    return;
  }
  tally_.abandoned += file->under_way.size();
  for (const auto& [id, urb] : file->under_way) {
    host_.cancel(id);
  }
  const std::set<std::uint8_t> claimed = file->claimed;
  for (const std::uint8_t interface : claimed) {
    drop_interface(*file, interface);
  }
  // Callbacks of its transfers look for the file before they use it.
  files_.erase(file);
  update_readiness();
}

void BusDevice::cancel_endpoints(UsbfsFile& file, std::uint8_t interface) {
  for (const auto& [id, urb] : file.under_way) {
    const Enumerated::Interface* owner = (urb.endpoint & 0x7FU) != 0 ? interface_of(urb.endpoint) : nullptr;
    if (owner != nullptr && owner->number == interface) {
      host_.cancel(id);
    }
  }
}

void BusDevice::drop_interface(UsbfsFile& file, std::uint8_t interface) {
  cancel_endpoints(file, interface);
  file.claimed.erase(interface);
  InterfaceState& state = interfaces_.at(interface);
  state.holder = nullptr;
  set_driver(interface, "");
  // As usb_unbind_interface(): whoever comes next finds the interface as it is after enumeration.
  if (state.setting != 0 && !gone_) {
    state.setting = 0;
    UsbTransfer transfer;
    transfer.setup = setup_packet(1, 11, 0, interface, 0);
    host_.submit(std::move(transfer), [](UsbCompletion&) {});
  }
}

void BusDevice::update_readiness() {
  node_.set_writable(std::any_of(files_.begin(), files_.end(),
                                 [this](UsbfsFile& file) { return ready_urb(file) != file.done.end(); }));
}

void BusDevice::add_waits(std::vector<pollfd>& files) const {
  server_.add_waits(files);
  if (hidraw_ != nullptr) {
    hidraw_->add_waits(files);
  }
  for (const auto& old : old_hidraws_) {
    old->add_waits(files);
  }
}

bool BusDevice::serve() {
  bool did = server_.serve();
  did = (hidraw_ != nullptr && hidraw_->serve()) || did;
  for (const auto& old : old_hidraws_) {
    did = old->serve() || did;
  }
  std::erase_if(old_hidraws_, [](const auto& old) { return old->finished(); });
  return did;
}

void BusDevice::leave() {
  if (gone_) {
    return;
  }
  unbind_hid();
  gone_ = true;
  left_at_ = std::chrono::steady_clock::now();
  for (const SysDevice& interface : interface_entries_) {
    testbed_.remove(interface);
  }
  testbed_.remove(entry_);
  if (!conditions_.hold_received) {
    node_.hang_up();
  }
  testbed_.announce(entry_, "remove");
}

void BusDevice::release_held() {
  update_readiness();
  if (gone_ && !conditions_.hold_received) {
    node_.hang_up();
  }
}

bool BusDevice::finished() const noexcept {
  return gone_ && !server_.in_use() && old_hidraws_.empty() &&
         std::chrono::steady_clock::now() > left_at_ + kLateOpens;
}

bool BusDevice::program_is_slow() const {
  return std::any_of(files_.begin(), files_.end(), [](const UsbfsFile& file) {
    return std::any_of(file.done.begin(), file.done.end(),
                       [](const Urb& urb) { return urb.endpoint > 0x80 && urb.actual > 0; });
  });
}

std::size_t BusDevice::under_way() const {
  std::size_t count = 0;
  for (const UsbfsFile& file : files_) {
    count += file.under_way.size();
  }
  return count;
}

void BusDevice::set_access(bool allowed) {
  node_.set_access(allowed);
  if (hidraw_ != nullptr) {
    hidraw_->set_access(allowed);
  }
}

void BusDevice::hold_by_other(std::uint8_t interface, bool held) {
  set_driver(interface, held ? "usbfs" : "");
}

}  // namespace scatter::mock_bus
