#include "tests/usb/mock_bus/hidraw.h"

#include <linux/hidraw.h>
#include <linux/input.h>
#include <sys/ioctl.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>

#include <fmt/format.h>

namespace scatter::mock_bus {

using simulator::UsbCompletion;
using simulator::UsbOutcome;
using simulator::UsbTransfer;

namespace {

constexpr std::size_t kReport = 64;
constexpr std::size_t kMostWaiting = 64;  ///< As HIDRAW_BUFFER_SIZE.

}  // namespace

Hidraw::Hidraw(Testbed& testbed, HostPort& host, Tally& tally, const Enumerated& enumerated,
               const Enumerated::Interface& interface, Place place)
    : testbed_(testbed),
      host_(host),
      tally_(tally),
      interface_(interface.number),
      vendor_(enumerated.vendor()),
      product_(enumerated.product_id()),
      name_(enumerated.manufacturer + " " + enumerated.product),
      server_(testbed.socket_of(fmt::format("dev/hidraw{}", place.number)), *this) {
  for (const std::uint8_t endpoint : interface.endpoints) {
    ((endpoint & 0x80U) != 0 ? in_ : out_) = endpoint;
  }
  (void)host_.control(setup_packet(0x21, 0x0A, 0, interface_, 0));  // SET_IDLE; may be refused.
  report_descriptor_ =
      host_.control(setup_packet(0x81, 6, 0x2200, interface_, interface.report_descriptor_bytes))
          .value_or(Bytes{});
  hid_.path =
      fmt::format("{}/0003:{:04X}:{:04X}.{:04X}", place.interface_path, vendor_, product_, place.number + 1);
  hid_.subsystem = "hid";
  hid_.properties = {{"DRIVER", "hid-generic"},
                     {"HID_ID", fmt::format("0003:{:08X}:{:08X}", vendor_, product_)},
                     {"HID_NAME", name_},
                     {"HID_UNIQ", enumerated.serial}};
  hid_.attributes = {
      {"report_descriptor",
       std::string(reinterpret_cast<const char*>(report_descriptor_.data()), report_descriptor_.size())}};
  hidraw_.path = fmt::format("{}/hidraw/hidraw{}", hid_.path, place.number);
  hidraw_.subsystem = "hidraw";
  hidraw_.node = fmt::format("hidraw{}", place.number);
  testbed_.add(hid_);
  testbed_.add(hidraw_, &node_);
  testbed_.set_link(hidraw_.path, "device",
                    fmt::format("../../../{}", hid_.path.substr(hid_.path.rfind('/') + 1)));
  if (place.announced) {
    testbed_.announce(hidraw_, "add");
  }
}

Hidraw::~Hidraw() {
  detach();
  *alive_ = false;
}

void Hidraw::detach() {
  if (!attached_) {
    return;
  }
  attached_ = false;
  detached_at_ = std::chrono::steady_clock::now();
  if (listening_ != 0) {
    host_.cancel(std::exchange(listening_, 0));
  }
  testbed_.remove(hidraw_);
  testbed_.remove(hid_);
  node_.hang_up();
  testbed_.announce(hidraw_, "remove");
  for (auto& [caller, file] : files_) {
    if (file.reading) {
      file.reading.reset();
      caller->answer(-1, EIO);
    }
  }
}

void Hidraw::opened(Caller& caller) {
  ++tally_.opened;
  files_.try_emplace(&caller);
  listen();
}

void Hidraw::closed(Caller& caller) {
  files_.erase(&caller);
  if (files_.empty() && listening_ != 0) {
    host_.cancel(std::exchange(listening_, 0));
  }
  update_readiness();
}

void Hidraw::listen() {
  if (listening_ != 0 || !attached_ || files_.empty()) {
    return;
  }
  UsbTransfer transfer;
  transfer.endpoint = in_;
  transfer.length = kReport;
  listening_ = host_.submit(std::move(transfer), [this, alive = alive_](UsbCompletion& completion) {
    if (!*alive || completion.id != listening_) {
      return;
    }
    listening_ = 0;
    if (completion.outcome != UsbOutcome::kDone) {
      return;  // The bus device sees the device leave.
    }
    for (auto& [caller, file] : files_) {
      if (file.reports.size() < kMostWaiting) {
        file.reports.push_back(completion.data);
      }
      if (file.reading) {
        const Call call = *std::exchange(file.reading, std::nullopt);
        give(*caller, file, call);
      }
    }
    update_readiness();
    listen();
  });
}

void Hidraw::update_readiness() {
  node_.set_readable(std::any_of(files_.begin(), files_.end(),
                                 [](const auto& each) { return !each.second.reports.empty(); }));
}

void Hidraw::give(Caller& caller, File& file, const Call& call) {
  const Bytes report = std::move(file.reports.front());
  file.reports.pop_front();
  const std::size_t size = std::min(report.size(), call.size);
  caller.write_memory(call.address, std::span(report).first(size));
  caller.answer(static_cast<long>(size));
}

void Hidraw::called(Caller& caller, const Call& call) {
  if (!attached_) {
    caller.answer(-1, call.kind == Call::Kind::kIoctl ? ENODEV : EIO);
    return;
  }
  switch (call.kind) {
    case Call::Kind::kRead: {
      File& file = files_[&caller];
      if (file.reports.empty()) {
        // All openers share one readiness: what poll() promised may have been another's report, and hidapi
        // reads without O_NONBLOCK after it.
        caller.answer(-1, EAGAIN);
      } else {
        give(caller, file, call);
        update_readiness();
      }
      return;
    }
    case Call::Kind::kWrite:
      write(caller, call);
      return;
    case Call::Kind::kIoctl:
      take_ioctl(caller, call);
      return;
  }
}

void Hidraw::write(Caller& caller, const Call& call) {
  Bytes bytes(call.size);
  if (call.size < 2 || !caller.read_memory(call.address, bytes)) {
    caller.answer(-1, EINVAL);
    return;
  }
  // The first byte is the report's number, which reports without numbers have as 0 and do not send.
  bytes.erase(bytes.begin());
  UsbTransfer transfer;
  transfer.endpoint = out_;
  transfer.data = std::move(bytes);
  host_.submit(std::move(transfer),
               [this, alive = alive_, whom = &caller, size = call.size](UsbCompletion& completion) {
                 if (*alive && files_.contains(whom)) {
                   const bool good = completion.outcome == UsbOutcome::kDone;
                   whom->answer(good ? static_cast<long>(size) : -1, good ? 0 : EIO);
                 }
               });
}

void Hidraw::take_ioctl(Caller& caller, const Call& call) {
  const std::size_t size = _IOC_SIZE(call.code);
  const auto text = [&](std::string_view value) {
    Bytes bytes(std::min(size, value.size() + 1));
    std::memcpy(bytes.data(), value.data(), std::min(bytes.size(), value.size()));
    caller.write_memory(call.address, bytes);
    caller.answer(static_cast<long>(bytes.size()));
  };
  if (_IOC_TYPE(call.code) != 'H') {
    caller.answer(-1, ENOTTY);
    return;
  }
  switch (_IOC_NR(call.code)) {
    case _IOC_NR(HIDIOCGRDESCSIZE):
      caller.write_object(call.address, static_cast<int>(report_descriptor_.size()));
      caller.answer(0);
      return;
    case _IOC_NR(HIDIOCGRDESC): {
      std::uint32_t room = 0;
      if (!caller.read_object(call.address, room)) {
        return;
      }
      const std::size_t part = std::min<std::size_t>(room, report_descriptor_.size());
      caller.write_memory(call.address + offsetof(hidraw_report_descriptor, value),
                          std::span(report_descriptor_).first(part));
      caller.answer(0);
      return;
    }
    case _IOC_NR(HIDIOCGRAWINFO): {
      hidraw_devinfo info{};
      info.bustype = BUS_USB;
      info.vendor = static_cast<__s16>(vendor_);
      info.product = static_cast<__s16>(product_);
      caller.write_object(call.address, info);
      caller.answer(0);
      return;
    }
    case _IOC_NR(HIDIOCGRAWNAME(0)):
      text(name_);
      return;
    case _IOC_NR(HIDIOCSFEATURE(0)):
      feature(caller, call, false);
      return;
    case _IOC_NR(HIDIOCGFEATURE(0)):
      feature(caller, call, true);
      return;
    default:
      tally_.violate(fmt::format("hidraw ioctl {:#x} is not served by this mock", call.code));
      caller.answer(-1, ENOTTY);
  }
}

void Hidraw::feature(Caller& caller, const Call& call, bool to_host) {
  const std::size_t size = _IOC_SIZE(call.code);
  if (size < 2) {
    caller.answer(-1, EINVAL);
    return;
  }
  UsbTransfer transfer;
  transfer.endpoint = to_host ? 0x80 : 0;
  transfer.setup = setup_packet(to_host ? 0xA1 : 0x21, to_host ? 0x01 : 0x09, 0x0300, interface_,
                                static_cast<std::uint16_t>(size - 1));
  if (to_host) {
    transfer.length = size - 1;
  } else {
    Bytes bytes(size);
    if (!caller.read_memory(call.address, bytes)) {
      return;
    }
    bytes.erase(bytes.begin());
    transfer.data = std::move(bytes);
  }
  host_.submit(std::move(transfer),
               [this, alive = alive_, whom = &caller, call, to_host, size](UsbCompletion& completion) {
                 if (!*alive || !files_.contains(whom)) {
                   return;
                 }
                 if (completion.outcome != UsbOutcome::kDone) {
                   whom->answer(-1, EPIPE);
                   return;
                 }
                 if (to_host) {
                   whom->write_memory(call.address + 1, completion.data);
                 }
                 whom->answer(static_cast<long>(to_host ? completion.data.size() + 1 : size));
               });
}

}  // namespace scatter::mock_bus
