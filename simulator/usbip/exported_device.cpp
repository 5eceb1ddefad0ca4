#include "simulator/usbip/exported_device.h"

#include <algorithm>
#include <utility>

#include <fmt/format.h>

namespace scatter::simulator::usbip {
namespace {

// Transfers of the bus itself (generation 0).
constexpr std::uint64_t kAddressId = 1;
constexpr std::uint64_t kDeviceDescriptorId = 2;
constexpr std::uint64_t kConfigurationId = 3;

constexpr std::uint8_t kSetAddress = 5;
constexpr std::uint8_t kGetDescriptor = 6;
constexpr std::uint8_t kSetConfiguration = 9;
constexpr std::uint8_t kDeviceDescriptor = 1;
constexpr std::uint8_t kConfigurationDescriptor = 2;
constexpr std::size_t kDeviceDescriptorBytes = 18;
constexpr std::size_t kMostConfigurationBytes = 4096;
/// A device that answers nonsense so often stays unnamed until it joins again.
constexpr int kMostQuestions = 3;
constexpr std::size_t kMostSpare = 32;

bool is_control(std::uint8_t endpoint) {
  return (endpoint & 0x0FU) == 0;
}

UrbStatus status_of(UsbOutcome outcome) {
  switch (outcome) {
    case UsbOutcome::kDone:
      return UrbStatus::kOk;
    case UsbOutcome::kStalled:
      return UrbStatus::kStalled;
    case UsbOutcome::kBabble:
      return UrbStatus::kOverflow;
    case UsbOutcome::kCancelled:
      return UrbStatus::kUnlinked;
    case UsbOutcome::kGone:
      return UrbStatus::kShutDown;
    case UsbOutcome::kError:
      break;
  }
  return UrbStatus::kProtocol;
}

}  // namespace

ExportedDevice::ExportedDevice(UsbPort& port, UsbBusSpeed speed) : port_(port), speed_(speed) {
  port_.plug(speed);
}

ExportedDevice::~ExportedDevice() {
  port_.unplug();
}

bool ExportedDevice::poll() {
  bool news = take_completions();
  if (!port_.plugged()) {
    port_.plug(speed_);  // A fault pulled the cable.
  }
  const bool on_bus = port_.present();
  const std::uint32_t joins = port_.joins();
  if (on_bus == on_bus_ && (joins == joins_ || !on_bus)) {
    return news;
  }
  on_bus_ = on_bus;
  record_.reset();
  left_ = held_;
  if (on_bus) {
    joins_ = joins;
    questions_ = 0;
    if (!held_) {
      ask_who();
    }
  }
  return true;
}

/// The reset that every holder's end is. A device may be another one after it: DFU mode ends so.
void ExportedDevice::start_again() {
  port_.reset();
  configured_ = false;
  if (!held_) {
    record_.reset();
  }
  questions_ = 0;
  ask_who();
}

/// With the address that Linux's virtual host keeps to itself.
void ExportedDevice::ask_who() {
  ++questions_;
  device_descriptor_.clear();
  port_.submit({.id = kAddressId,
                .endpoint = 0,
                .setup = {0x00, kSetAddress, kDeviceNumber, 0, 0, 0, 0, 0},
                .data = {}});
  control_in(kDeviceDescriptorId, kDeviceDescriptor, kDeviceDescriptorBytes);
  control_in(kConfigurationId, kConfigurationDescriptor, kMostConfigurationBytes);
}

void ExportedDevice::control_in(std::uint64_t id, std::uint8_t descriptor, std::size_t length) {
  port_.submit({.id = id,
                .endpoint = 0x80,
                .setup = {0x80, kGetDescriptor, 0, descriptor, 0, 0,
                          static_cast<std::uint8_t>(length & 0xFFU), static_cast<std::uint8_t>(length >> 8U)},
                .data = {},
                .length = length});
}

void ExportedDevice::learn(UsbCompletion&& completion) {
  if (completion.id == kDeviceDescriptorId) {
    device_descriptor_ = std::move(completion.data);
  }
  if (completion.id != kConfigurationId || completion.outcome == UsbOutcome::kGone) {
    return;
  }
  std::optional<DeviceRecord> record = read_descriptors(device_descriptor_, completion.data);
  if (!record) {
    if (questions_ < kMostQuestions) {
      ask_who();
    }
    return;
  }
  record->bus_id = kBusId;
  record->bus_number = kBusNumber;
  record->device_number = kDeviceNumber;
  record->speed = speed_ == UsbBusSpeed::kHigh ? Speed::kHigh : Speed::kFull;
  // The holder's system has read the descriptors before its SET_CONFIGURATION made this reset.
  left_ = left_ || (held_ && record_ && *record != *record_);
  record_ = std::move(record);
}

bool ExportedDevice::take_completions() {
  bool news = false;
  while (auto completion = port_.next_completion()) {
    const auto generation = static_cast<std::uint32_t>(completion->id >> 32U);
    if (generation == 0) {
      learn(std::move(*completion));
    } else if (generation == generation_ && held_) {
      complete(std::move(*completion));
    }
    news = true;
  }
  return news;
}

void ExportedDevice::complete(UsbCompletion&& completion) {
  const auto sequence = static_cast<std::uint32_t>(completion.id);
  const auto found = under_way_.find(sequence);
  if (found == under_way_.end()) {
    return;
  }
  const UnderWay transfer = found->second;
  under_way_.erase(found);
  bytes_under_way_ -= transfer.bytes;
  UrbStatus status = status_of(completion.outcome);
  // USB/IP can only say "stopped" of a transfer that moved nothing; one that moved some bytes is replied to
  // with them, or they would be lost.
  if (completion.outcome == UsbOutcome::kCancelled && transfer.unlink && completion.actual == 0) {
    replies_.push_back({unlink_reply(*transfer.unlink, UrbStatus::kUnlinked), {}});
    return;
  }
  if (!transfer.to_host) {
    completion.data.clear();
  } else {
    completion.data.resize(std::min(completion.data.size(), transfer.bytes));
    completion.actual = completion.data.size();
    if (status == UrbStatus::kOk && transfer.short_not_ok && completion.actual < transfer.bytes) {
      status = UrbStatus::kShort;
    }
  }
  replies_.push_back({submit_reply(sequence, status, completion.actual), std::move(completion.data)});
  if (transfer.unlink) {
    replies_.push_back({unlink_reply(*transfer.unlink, UrbStatus::kOk), {}});
  }
}

OpStatus ExportedDevice::import(std::string_view bus_id) {
  if (bus_id != kBusId) {
    return OpStatus::kNoDevice;
  }
  if (held_) {
    return OpStatus::kBusy;
  }
  if (!record_) {
    return on_bus_ && questions_ >= kMostQuestions ? OpStatus::kDeviceError : OpStatus::kNotAvailable;
  }
  held_ = true;
  left_ = false;
  configured_ = false;
  return OpStatus::kOk;
}

void ExportedDevice::release() {
  ++generation_;
  generation_ += generation_ == 0 ? 1 : 0;
  held_ = false;
  left_ = false;
  under_way_.clear();
  bytes_under_way_ = 0;
  replies_.clear();
  if (!on_bus_) {
    return;
  }
  if (record_) {
    start_again();
  } else {
    ask_who();  // It has joined anew: nothing to reset.
  }
}

void ExportedDevice::refuse(const SubmitUrb& urb, UrbStatus status) {
  replies_.push_back({submit_reply(urb.sequence, status, 0), {}});
}

std::string ExportedDevice::submit(SubmitUrb&& urb) {
  if (urb.device != (kBusNumber << 16U | kDeviceNumber)) {
    return fmt::format("a transfer for device {:#x} when it should be {:#x}", urb.device,
                       kBusNumber << 16U | kDeviceNumber);
  }
  if (under_way_.contains(urb.sequence)) {
    return fmt::format("transfer {} is under way already", urb.sequence);
  }
  if (under_way_.size() >= kMostUnderWay || bytes_under_way_ + urb.length > kMostBytesUnderWay) {
    refuse(urb, UrbStatus::kNoMemory);
    return {};
  }
  const bool to_host = (urb.endpoint & 0x80U) != 0;
  if (is_control(urb.endpoint)) {
    const auto wanted = static_cast<std::size_t>(urb.setup[6] | urb.setup[7] << 8U);
    const bool asks_to_host = (urb.setup[0] & 0x80U) != 0;
    if (wanted != urb.length || (wanted != 0 && asks_to_host != to_host)) {
      refuse(urb, UrbStatus::kInvalid);
      return {};
    }
    if (urb.setup[0] == 0x00 && urb.setup[1] == kSetConfiguration) {
      if (configured_) {
        start_again();
        take_completions();
      }
      configured_ = (urb.setup[2] | urb.setup[3]) != 0;
    }
  }
  under_way_.emplace(urb.sequence, UnderWay{.bytes = urb.length,
                                            .to_host = to_host,
                                            .short_not_ok = to_host && urb.short_not_ok,
                                            .unlink = {}});
  bytes_under_way_ += urb.length;
  if (to_host && !spare_.empty()) {
    urb.data = std::move(spare_.back());
    spare_.pop_back();
  }
  port_.submit({.id = port_id(urb.sequence),
                .endpoint = urb.endpoint,
                .setup = urb.setup,
                .data = std::move(urb.data),
                .length = to_host ? urb.length : 0});
  return {};
}

std::string ExportedDevice::unlink(const UnlinkUrb& urb) {
  const auto found = under_way_.find(urb.victim);
  if (found == under_way_.end()) {
    replies_.push_back({unlink_reply(urb.sequence, UrbStatus::kOk), {}});
    return {};
  }
  if (found->second.unlink) {
    return fmt::format("transfer {} is being stopped already", urb.victim);
  }
  found->second.unlink = urb.sequence;
  // What has been completed already is replied to first, as the client expects; then there is nothing to
  // cancel.
  (void)port_.cancel(port_id(urb.victim));
  take_completions();
  return {};
}

std::optional<Reply> ExportedDevice::next_reply() {
  // What a transfer found waiting is complete as soon as it is submitted.
  if (replies_.empty()) {
    (void)take_completions();
  }
  if (replies_.empty()) {
    return std::nullopt;
  }
  Reply reply = std::move(replies_.front());
  replies_.pop_front();
  return reply;
}

void ExportedDevice::reuse(std::vector<std::byte>&& data) {
  if (data.capacity() > 0 && spare_.size() < kMostSpare) {
    data.clear();
    spare_.push_back(std::move(data));
  }
}

}  // namespace scatter::simulator::usbip
