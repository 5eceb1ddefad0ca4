#include "tests/usb/port_host.h"

#include <algorithm>
#include <chrono>
#include <thread>
#include <utility>

#include "protocol/usb_identity.h"

namespace scatter::usb_test {

using simulator::UsbCompletion;
using simulator::UsbOutcome;

namespace {

// USB 2.0, table 9-4 and 9-5.
constexpr std::uint8_t kClearFeature = 1;
constexpr std::uint8_t kSetAddress = 5;
constexpr std::uint8_t kGetDescriptor = 6;
constexpr std::uint8_t kSetConfiguration = 9;
constexpr std::uint8_t kSetInterface = 11;
constexpr std::uint8_t kDeviceDescriptor = 1;
constexpr std::uint8_t kConfigurationDescriptor = 2;
constexpr std::uint8_t kToHost = 0x80;
constexpr std::uint8_t kToInterface = 0x01;
constexpr std::uint8_t kToEndpoint = 0x02;

std::uint16_t word_at(const Bytes& bytes, std::size_t at) {
  return static_cast<std::uint16_t>(std::to_integer<unsigned>(bytes[at]) |
                                    std::to_integer<unsigned>(bytes[at + 1]) << 8U);
}

}  // namespace

PortHost::PortHost(std::shared_ptr<simulator::VirtualInstrument> instrument)
    : instrument_(std::move(instrument)), port_(*instrument_->usb()) {}

bool PortHost::plug(simulator::UsbBusSpeed speed) {
  if (!port_.plugged()) {
    port_.plug(speed);
  }
  const std::uint64_t deadline = instrument_->now_us() + kPatienceUs;
  while (!port_.present()) {
    if (!run(deadline) && !port_.present()) {
      return false;
    }
  }
  return true;
}

bool PortHost::enumerate() {
  port_.reset();
  device_descriptor_ = descriptor(kDeviceDescriptor, 0, 64);
  if (device_descriptor_.size() != 18 || !control_out({.request = kSetAddress, .value = 5})) {
    return false;
  }
  const Bytes head = descriptor(kConfigurationDescriptor, 0, 9);
  if (head.size() != 9) {
    return false;
  }
  configuration_ = descriptor(kConfigurationDescriptor, 0, word_at(head, 2));
  return configuration_.size() == word_at(head, 2) &&
         control_out(
             {.request = kSetConfiguration, .value = std::to_integer<std::uint16_t>(configuration_[5])});
}

bool PortHost::open_stream() {
  return plug() && enumerate() && select_stream(protocol::usb::kStreamOpenSetting);
}

bool PortHost::select_stream(std::uint8_t setting) {
  return control_out({.type = kToInterface,
                      .request = kSetInterface,
                      .value = setting,
                      .index = protocol::usb::kStreamInterface});
}

std::optional<UsbCompletion> PortHost::control(const Request& request, std::uint16_t length, Bytes data) {
  const bool in = (request.type & kToHost) != 0;
  const std::uint64_t id = next_id_++;
  const auto low = [](std::uint16_t word) { return static_cast<std::uint8_t>(word & 0xFFU); };
  const auto high = [](std::uint16_t word) { return static_cast<std::uint8_t>(word >> 8U); };
  port_.submit({.id = id,
                .endpoint = in ? kToHost : std::uint8_t{0},
                .setup = {request.type, request.request, low(request.value), high(request.value),
                          low(request.index), high(request.index), low(length), high(length)},
                .data = std::move(data),
                .length = in ? length : 0U});
  auto completion = wait_for(id);
  if (!completion) {
    cancel(id);
  }
  return completion;
}

Bytes PortHost::control_in(const Request& request, std::uint16_t length) {
  auto completion = control(request, length);
  return completion && completion->outcome == UsbOutcome::kDone ? std::move(completion->data) : Bytes{};
}

bool PortHost::control_out(const Request& request, Bytes data) {
  const auto length = static_cast<std::uint16_t>(data.size());
  const auto completion = control(request, length, std::move(data));
  return completion && completion->outcome == UsbOutcome::kDone && completion->actual == length;
}

Bytes PortHost::descriptor(std::uint8_t type, std::uint8_t index, std::uint16_t length,
                           std::uint16_t language) {
  return control_in({.type = kToHost,
                     .request = kGetDescriptor,
                     .value = static_cast<std::uint16_t>(type << 8U | index),
                     .index = language},
                    length);
}

bool PortHost::clear_halt(std::uint8_t endpoint) {
  return control_out({.type = kToEndpoint, .request = kClearFeature, .value = 0, .index = endpoint});
}

std::uint64_t PortHost::submit_in(std::uint8_t endpoint, std::size_t length, Bytes memory) {
  const std::uint64_t id = next_id_++;
  port_.submit({.id = id, .endpoint = endpoint, .data = std::move(memory), .length = length});
  return id;
}

std::uint64_t PortHost::submit_out(std::uint8_t endpoint, Bytes data) {
  const std::uint64_t id = next_id_++;
  port_.submit({.id = id, .endpoint = endpoint, .data = std::move(data)});
  return id;
}

void PortHost::collect() {
  while (auto completion = port_.next_completion()) {
    const std::uint64_t id = completion->id;
    finished_.insert_or_assign(id, std::move(*completion));
  }
}

std::optional<UsbCompletion> PortHost::take(std::uint64_t id) {
  collect();
  const auto found = finished_.find(id);
  if (found == finished_.end()) {
    return std::nullopt;
  }
  std::optional<UsbCompletion> completion(std::move(found->second));
  finished_.erase(found);
  return completion;
}

std::optional<UsbCompletion> PortHost::wait_for(std::uint64_t id, std::uint64_t patience_us) {
  const std::uint64_t deadline = instrument_->now_us() + patience_us;
  while (true) {
    if (auto completion = take(id)) {
      return completion;
    }
    if (!run(deadline)) {
      return take(id);
    }
  }
}

void PortHost::cancel(std::uint64_t id) {
  (void)port_.cancel(id);
  (void)take(id);
}

bool PortHost::run(std::uint64_t until_us) {
  const std::size_t under_way = port_.under_way();
  const std::uint32_t joins = port_.joins();
  const std::uint64_t wake = instrument_->run_ready();
  if (port_.under_way() != under_way || port_.joins() != joins) {
    return true;
  }
  const std::uint64_t now = instrument_->now_us();
  if (now >= until_us) {
    return false;
  }
  if (instrument_->clock_mode() == simulator::ClockMode::kVirtual) {
    instrument_->advance_to(std::min(wake, until_us));
  } else if (wake > now) {
    const std::uint64_t pause = std::min({wake - now, until_us - now, std::uint64_t{10'000}});
    std::this_thread::sleep_for(std::chrono::microseconds(pause));
  }
  return true;
}

void PortHost::run_for(std::uint64_t duration_us) {
  const std::uint64_t end = instrument_->now_us() + duration_us;
  while (run(end)) {
  }
}

}  // namespace scatter::usb_test
