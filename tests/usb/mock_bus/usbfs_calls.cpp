// The ioctls of /dev/bus/usb/BBB/DDD (linux/drivers/usb/core/devio.c is the model).
#include <linux/usbdevice_fs.h>
#include <sys/ioctl.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstddef>
#include <cstring>
#include <utility>

#include <fmt/format.h>

#include "tests/usb/mock_bus/bus_device.h"

namespace scatter::mock_bus {

using simulator::UsbCompletion;
using simulator::UsbOutcome;
using simulator::UsbTransfer;

namespace {

/// No mapped buffers: the device file is no memory that two processes could share.
constexpr std::uint32_t kCapabilities = USBDEVFS_CAP_ZERO_PACKET | USBDEVFS_CAP_BULK_CONTINUATION |
                                        USBDEVFS_CAP_NO_PACKET_SIZE_LIM | USBDEVFS_CAP_BULK_SCATTER_GATHER |
                                        USBDEVFS_CAP_REAP_AFTER_DISCONNECT;

/// More transfers than any program has under way: it goes on although it was told that the device is gone.
constexpr unsigned kMostAfterGone = 128;

int status_of(UsbOutcome outcome) {
  switch (outcome) {
    case UsbOutcome::kDone:
      return 0;
    case UsbOutcome::kStalled:
      return -EPIPE;
    case UsbOutcome::kBabble:
      return -EOVERFLOW;
    case UsbOutcome::kError:
      return -EPROTO;
    case UsbOutcome::kCancelled:
      return -ENOENT;
    case UsbOutcome::kGone:
      return -ESHUTDOWN;
  }
  return -EPROTO;
}

void answer_status(UsbfsFile& file, int status) {
  file.caller->answer(status < 0 ? -1 : status, status < 0 ? -status : 0);
}

}  // namespace

void BusDevice::called(Caller& caller, const Call& call) {
  const auto found = std::find_if(files_.begin(), files_.end(),
                                  [&](const UsbfsFile& each) { return each.caller == &caller; });
  if (found == files_.end() || call.kind != Call::Kind::kIoctl) {
    tally_.violate(fmt::format("{}: a read or write of a usbfs file", entry_.node));
    caller.answer(-1, EINVAL);
    return;
  }
  UsbfsFile& file = *found;
  const auto code = static_cast<unsigned>(call.code);
  if (code == static_cast<unsigned>(USBDEVFS_REAPURBNDELAY)) {
    reap(file, call);
    return;
  }
  if (gone_) {
    if (code == static_cast<unsigned>(USBDEVFS_SUBMITURB) && file.told_gone &&
        ++file.after_gone == kMostAfterGone) {
      tally_.violate("transfers are handed in again and again after the device is known to be gone");
    }
    file.told_gone = true;
    caller.answer(-1, ENODEV);
    return;
  }
  switch (code) {
    case static_cast<unsigned>(USBDEVFS_GET_CAPABILITIES):
      caller.write_object(call.address, kCapabilities);
      caller.answer(0);
      return;
    case static_cast<unsigned>(USBDEVFS_SUBMITURB):
      submit(file, call);
      return;
    case static_cast<unsigned>(USBDEVFS_DISCARDURB):
      discard(file, call);
      return;
    case static_cast<unsigned>(USBDEVFS_CLAIMINTERFACE):
    case static_cast<unsigned>(USBDEVFS_RELEASEINTERFACE): {
      unsigned interface = 0;
      if (caller.read_object(call.address, interface)) {
        const auto number = static_cast<std::uint8_t>(std::min(interface, 255U));
        answer_status(file, code == static_cast<unsigned>(USBDEVFS_CLAIMINTERFACE) ? claim(file, number)
                                                                                   : release(file, number));
      }
      return;
    }
    case static_cast<unsigned>(USBDEVFS_SETINTERFACE):
      set_interface(file, call);
      return;
    case static_cast<unsigned>(USBDEVFS_CLEAR_HALT):
    case static_cast<unsigned>(USBDEVFS_RESETEP):
      clear_halt(file, call);
      return;
    case static_cast<unsigned>(USBDEVFS_SETCONFIGURATION):
      set_configuration(file, call);
      return;
    case static_cast<unsigned>(USBDEVFS_RESET):
      reset(file);
      return;
    case static_cast<unsigned>(USBDEVFS_GETDRIVER):
      get_driver(file, call);
      return;
    case static_cast<unsigned>(USBDEVFS_IOCTL):
      driver_ioctl(file, call);
      return;
    case static_cast<unsigned>(USBDEVFS_DISCONNECT_CLAIM):
      disconnect_claim(file, call);
      return;
    case static_cast<unsigned>(USBDEVFS_GET_SPEED):
      caller.answer(place_.speed_mbps == 480 ? 3 : 2);  // enum usb_device_speed.
      return;
    default:
      tally_.violate(fmt::format("usbfs ioctl {:#x} is not served by this mock", code));
      caller.answer(-1, ENOTTY);
  }
}

bool BusDevice::used_unclaimed(UsbfsFile& file, std::uint8_t interface) {
  if (file.claimed.contains(interface)) {
    return false;
  }
  // The kernel claims by itself and complains in its log; a program that gets there has a fault.
  tally_.violate(fmt::format("interface {} is used without being claimed", interface));
  return true;
}

void BusDevice::submit(UsbfsFile& file, const Call& call) {
  usbdevfs_urb request{};
  if (!file.caller->read_object(call.address, request)) {
    return;
  }
  const bool control = request.type == USBDEVFS_URB_TYPE_CONTROL;
  const auto size = static_cast<std::size_t>(std::max(request.buffer_length, 0));
  if (!control) {
    const Enumerated::Interface* owner = interface_of(request.endpoint);
    if (owner == nullptr) {
      answer_status(file, -ENOENT);
      return;
    }
    if (used_unclaimed(file, owner->number)) {
      answer_status(file, -EBUSY);
      return;
    }
  }
  std::size_t held = size;
  for (const UsbfsFile& each : files_) {
    held += memory_of(each);
  }
  if (conditions_.memory_limit != 0 && held > conditions_.memory_limit) {
    ++tally_.refused_memory;
    answer_status(file, -ENOMEM);
    return;
  }
  Urb urb;
  urb.address = call.address;
  urb.buffer = reinterpret_cast<std::uint64_t>(request.buffer);
  urb.endpoint = request.endpoint;
  urb.size = size;
  UsbTransfer transfer;
  transfer.endpoint = request.endpoint;
  Bytes bytes;
  if (control) {
    bytes.resize(size);
    if (size < 8 || !file.caller->read_memory(urb.buffer, bytes)) {
      answer_status(file, -EINVAL);
      return;
    }
    for (std::size_t k = 0; k < 8; ++k) {
      transfer.setup[k] = std::to_integer<std::uint8_t>(bytes[k]);
    }
    const bool to_host = (transfer.setup[0] & 0x80U) != 0;
    // Not to the standard requests that everybody may make of an interface.
    const bool of_interface = (transfer.setup[0] & 0x1FU) == 1 && (transfer.setup[0] & 0x60U) != 0x40;
    if (of_interface && has_interface(transfer.setup[4]) && used_unclaimed(file, transfer.setup[4])) {
      answer_status(file, -EBUSY);
      return;
    }
    transfer.endpoint = to_host ? 0x80 : 0;
    urb.endpoint = transfer.endpoint;
    urb.buffer += 8;
    transfer.length = to_host ? size - 8 : 0;
    if (!to_host) {
      transfer.data.assign(bytes.begin() + 8, bytes.end());
    }
  } else if ((request.endpoint & 0x80U) != 0) {
    transfer.length = size;
  } else {
    transfer.data.resize(size);
    if (!file.caller->read_memory(urb.buffer, transfer.data)) {
      return;
    }
  }
  ++tally_.submitted;
  UsbfsFile* const whose = &file;
  const std::uint64_t id =
      host_.submit(std::move(transfer), [this, alive = alive_, whose](UsbCompletion& completion) {
        if (*alive && std::any_of(files_.begin(), files_.end(), [&](const UsbfsFile& each) {
              return &each == whose && each.under_way.contains(completion.id);
            })) {
          take_urb(*whose, completion.id, completion);
        }
      });
  file.under_way.emplace(id, std::move(urb));
  tally_.most_under_way = std::max(
      tally_.most_under_way,
      static_cast<std::size_t>(std::count_if(file.under_way.begin(), file.under_way.end(),
                                             [](const auto& each) { return each.second.endpoint == 0x81; })));
  answer_status(file, 0);
}

void BusDevice::take_urb(UsbfsFile& file, std::uint64_t id, UsbCompletion& completion) {
  auto node = file.under_way.extract(id);
  Urb& urb = node.mapped();
  urb.status = status_of(completion.outcome);
  urb.actual = completion.actual;
  urb.data = std::move(completion.data);
  if (urb.endpoint != 0 && urb.endpoint != 0x80) {
    ((urb.endpoint & 0x80U) != 0 ? tally_.bytes_in : tally_.bytes_out) += urb.actual;
  }
  file.done.push_back(std::move(urb));
  update_readiness();
}

std::deque<Urb>::iterator BusDevice::ready_urb(UsbfsFile& file) const {
  return std::find_if(file.done.begin(), file.done.end(), [this](const Urb& urb) {
    return (urb.endpoint & 0x80U) != 0 ? !conditions_.hold_received : !conditions_.hold_sent;
  });
}

void BusDevice::reap(UsbfsFile& file, const Call& call) {
  const auto ready = ready_urb(file);
  if (ready == file.done.end()) {
    ++tally_.empty_reaps;
    answer_status(file, gone_ && file.done.empty() ? -ENODEV : -EAGAIN);
    return;
  }
  const Urb urb = std::move(*ready);
  file.done.erase(ready);
  ++tally_.reaped;
  file.told_gone = file.told_gone || urb.status == -ESHUTDOWN;
  Caller& caller = *file.caller;
  caller.write_memory(urb.buffer, urb.data);
  caller.write_object(urb.address + offsetof(usbdevfs_urb, status), urb.status);
  caller.write_object(urb.address + offsetof(usbdevfs_urb, actual_length), static_cast<int>(urb.actual));
  caller.write_object(call.address, urb.address);
  update_readiness();
  answer_status(file, 0);
}

void BusDevice::discard(UsbfsFile& file, const Call& call) {
  const auto found = std::find_if(file.under_way.begin(), file.under_way.end(),
                                  [&](const auto& each) { return each.second.address == call.address; });
  if (found == file.under_way.end()) {
    answer_status(file, -EINVAL);
    return;
  }
  ++tally_.discarded;
  host_.cancel(found->first);
  host_.dispatch();
  answer_status(file, 0);
}

int BusDevice::claim(UsbfsFile& file, std::uint8_t interface) {
  if (!has_interface(interface)) {
    return -ENOENT;
  }
  InterfaceState& state = interfaces_.at(interface);
  if (state.holder == &file) {
    tally_.violate(fmt::format("interface {} is claimed twice by one file", interface));
    return 0;
  }
  if (!state.driver.empty()) {
    return -EBUSY;
  }
  set_driver(interface, "usbfs");
  state.holder = &file;
  file.claimed.insert(interface);
  return 0;
}

int BusDevice::release(UsbfsFile& file, std::uint8_t interface) {
  if (!file.claimed.contains(interface)) {
    return -EINVAL;
  }
  const auto left = std::count_if(file.under_way.begin(), file.under_way.end(), [&](const auto& each) {
    const std::uint8_t endpoint = each.second.endpoint;
    const Enumerated::Interface* owner = (endpoint & 0x7FU) != 0 ? interface_of(endpoint) : nullptr;
    return owner != nullptr && owner->number == interface;
  });
  if (left > 0) {
    tally_.violate(fmt::format("interface {} is released with {} transfers under way", interface, left));
  }
  drop_interface(file, interface);
  host_.dispatch();
  return 0;
}

void BusDevice::control_later(UsbfsFile& file, const Setup& setup, std::function<void()> then) {
  UsbTransfer transfer;
  transfer.setup = setup;
  file.waiting = true;
  host_.submit(std::move(transfer), [this, alive = alive_, whose = &file,
                                     then = std::move(then)](UsbCompletion& completion) {
    const bool there = *alive && std::any_of(files_.begin(), files_.end(),
                                             [&](const UsbfsFile& each) { return &each == whose; });
    if (!there) {
      return;
    }
    whose->waiting = false;
    if (completion.outcome == UsbOutcome::kDone && then) {
      then();
    }
    answer_status(*whose, status_of(completion.outcome));
  });
}

void BusDevice::set_interface(UsbfsFile& file, const Call& call) {
  usbdevfs_setinterface request{};
  if (!file.caller->read_object(call.address, request)) {
    return;
  }
  const auto interface = static_cast<std::uint8_t>(request.interface);
  const auto setting = static_cast<std::uint8_t>(request.altsetting);
  const bool exists =
      std::any_of(enumerated_.interfaces.begin(), enumerated_.interfaces.end(),
                  [&](const auto& each) { return each.number == interface && each.setting == setting; });
  if (!exists) {
    answer_status(file, -EINVAL);
    return;
  }
  if (used_unclaimed(file, interface)) {
    answer_status(file, -EBUSY);
    return;
  }
  cancel_endpoints(file, interface);
  control_later(file, setup_packet(1, 11, setting, interface, 0),
                [this, interface, setting] { interfaces_.at(interface).setting = setting; });
}

void BusDevice::clear_halt(UsbfsFile& file, const Call& call) {
  unsigned endpoint = 0;
  if (!file.caller->read_object(call.address, endpoint)) {
    return;
  }
  const Enumerated::Interface* owner = interface_of(static_cast<std::uint8_t>(endpoint));
  if (owner == nullptr) {
    answer_status(file, -ENOENT);
  } else if (used_unclaimed(file, owner->number)) {
    answer_status(file, -EBUSY);
  } else {
    control_later(file, setup_packet(2, 1, 0, static_cast<std::uint16_t>(endpoint), 0));
  }
}

void BusDevice::set_configuration(UsbfsFile& file, const Call& call) {
  int configuration = 0;
  if (!file.caller->read_object(call.address, configuration)) {
    return;
  }
  if (configuration != 1) {
    answer_status(file, -EINVAL);
    return;
  }
  const bool busy = std::any_of(interfaces_.begin(), interfaces_.end(),
                                [](const InterfaceState& state) { return !state.driver.empty(); });
  if (busy) {
    answer_status(file, -EBUSY);
    return;
  }
  control_later(file, setup_packet(0, 9, 1, 0, 0));
}

void BusDevice::reset(UsbfsFile& file) {
  host_.peripheral().port().reset();
  host_.dispatch();
  const std::optional<Enumerated> again = host_.enumerate(static_cast<std::uint8_t>(place_.address));
  const bool same =
      again && again->device == enumerated_.device && again->configuration == enumerated_.configuration;
  for (InterfaceState& state : interfaces_) {
    state.setting = 0;
  }
  if (!same) {
    // Another device than before, or none: the hub takes it for unplugged.
    leave();
  }
  answer_status(file, same ? 0 : -ENODEV);
}

void BusDevice::get_driver(UsbfsFile& file, const Call& call) {
  usbdevfs_getdriver request{};
  if (!file.caller->read_object(call.address, request)) {
    return;
  }
  const std::string driver =
      request.interface < interfaces_.size() ? interfaces_[request.interface].driver : "";
  if (driver.empty()) {
    answer_status(file, -ENODATA);
    return;
  }
  std::memset(request.driver, 0, sizeof request.driver);
  std::memcpy(request.driver, driver.data(), std::min(driver.size(), sizeof request.driver - 1));
  file.caller->write_object(call.address, request);
  answer_status(file, 0);
}

int BusDevice::disconnect(std::uint8_t interface) {
  if (interface >= interfaces_.size() || interfaces_[interface].driver.empty()) {
    return -ENODATA;
  }
  if (interfaces_[interface].driver == "usbfs") {
    return -EBUSY;
  }
  unbind_hid();
  set_driver(interface, "");
  return 0;
}

void BusDevice::driver_ioctl(UsbfsFile& file, const Call& call) {
  usbdevfs_ioctl request{};
  if (!file.caller->read_object(call.address, request)) {
    return;
  }
  const auto interface = static_cast<std::uint8_t>(request.ifno);
  if (!has_interface(interface)) {
    answer_status(file, -EINVAL);
  } else if (static_cast<unsigned>(request.ioctl_code) == static_cast<unsigned>(USBDEVFS_DISCONNECT)) {
    answer_status(file, disconnect(interface));
  } else if (static_cast<unsigned>(request.ioctl_code) == static_cast<unsigned>(USBDEVFS_CONNECT)) {
    const bool is_hid =
        std::any_of(enumerated_.interfaces.begin(), enumerated_.interfaces.end(),
                    [&](const auto& each) { return each.number == interface && each.klass == 3; });
    if (!interfaces_.at(interface).driver.empty()) {
      answer_status(file, -EBUSY);
      return;
    }
    if (is_hid && conditions_.hid_driver) {
      bind_hid(interface, true);
    }
    answer_status(file, interfaces_.at(interface).driver.empty() ? 0 : 1);
  } else {
    tally_.violate(fmt::format("driver ioctl {:#x} is not served by this mock", request.ioctl_code));
    answer_status(file, -ENOTTY);
  }
}

void BusDevice::disconnect_claim(UsbfsFile& file, const Call& call) {
  usbdevfs_disconnect_claim request{};
  if (!file.caller->read_object(call.address, request)) {
    return;
  }
  const auto interface = static_cast<std::uint8_t>(request.interface);
  if (!has_interface(interface)) {
    answer_status(file, -EINVAL);
    return;
  }
  const std::string& driver = interfaces_.at(interface).driver;
  const std::string named(request.driver, ::strnlen(request.driver, sizeof request.driver));
  if (!driver.empty() &&
      (((request.flags & USBDEVFS_DISCONNECT_CLAIM_IF_DRIVER) != 0 && driver != named) ||
       ((request.flags & USBDEVFS_DISCONNECT_CLAIM_EXCEPT_DRIVER) != 0 && driver == named))) {
    answer_status(file, -EBUSY);
    return;
  }
  if (!driver.empty()) {
    if (const int status = disconnect(interface); status < 0) {
      answer_status(file, status);
      return;
    }
  }
  answer_status(file, claim(file, interface));
}

}  // namespace scatter::mock_bus
