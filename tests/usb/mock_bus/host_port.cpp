#include "tests/usb/mock_bus/host_port.h"

#include <algorithm>
#include <utility>

namespace scatter::mock_bus {

using simulator::UsbCompletion;
using simulator::UsbOutcome;
using simulator::UsbTransfer;

namespace {

constexpr std::uint8_t kGetDescriptor = 6;
constexpr std::uint16_t kEnglish = 0x0409;

unsigned at(const Bytes& bytes, std::size_t index) {
  return std::to_integer<unsigned>(bytes.at(index));
}

/// Every alternate setting of a configuration; what does not fit its lengths ends the list.
std::vector<Enumerated::Interface> interfaces_of(const Bytes& configuration) {
  std::vector<Enumerated::Interface> interfaces;
  for (std::size_t k = 0; k + 2 <= configuration.size();) {
    const unsigned length = at(configuration, k);
    const unsigned kind = at(configuration, k + 1);
    if (length < 2 || k + length > configuration.size()) {
      break;
    }
    if (kind == 4 && length >= 9) {
      Enumerated::Interface interface;
      interface.number = static_cast<std::uint8_t>(at(configuration, k + 2));
      interface.setting = static_cast<std::uint8_t>(at(configuration, k + 3));
      interface.klass = static_cast<std::uint8_t>(at(configuration, k + 5));
      interface.subclass = static_cast<std::uint8_t>(at(configuration, k + 6));
      interface.protocol = static_cast<std::uint8_t>(at(configuration, k + 7));
      interfaces.push_back(std::move(interface));
    } else if (kind == 5 && length >= 7 && !interfaces.empty()) {
      interfaces.back().endpoints.push_back(static_cast<std::uint8_t>(at(configuration, k + 2)));
    } else if (kind == 0x21 && length >= 9 && !interfaces.empty() && interfaces.back().klass == 3) {
      interfaces.back().report_descriptor_bytes =
          static_cast<std::uint16_t>(at(configuration, k + 7) | at(configuration, k + 8) << 8U);
    }
    k += length;
  }
  return interfaces;
}

}  // namespace

Setup setup_packet(std::uint8_t type, std::uint8_t request, std::uint16_t value, std::uint16_t index,
                   std::uint16_t length) {
  const auto low = [](std::uint16_t word) { return static_cast<std::uint8_t>(word & 0xFFU); };
  const auto high = [](std::uint16_t word) { return static_cast<std::uint8_t>(word >> 8U); };
  return {type, request, low(value), high(value), low(index), high(index), low(length), high(length)};
}

std::uint64_t HostPort::submit(UsbTransfer transfer, Done done) {
  transfer.id = next_id_++;
  const std::uint64_t id = transfer.id;
  under_way_.emplace(id, std::move(done));
  if (powerless) {
    failing_.push_back(id);
  } else {
    peripheral_.port().submit(std::move(transfer));
  }
  return id;
}

bool HostPort::cancel(std::uint64_t id) {
  // One that fails for lack of power is about to end by itself.
  return peripheral_.port().cancel(id);
}

bool HostPort::dispatch() {
  bool any = false;
  while (std::optional<UsbCompletion> completion = peripheral_.port().next_completion()) {
    any = true;
    if (powerless && completion->outcome == UsbOutcome::kGone) {
      completion->outcome = UsbOutcome::kError;
    }
    finish(*completion);
  }
  for (const std::uint64_t id : std::exchange(failing_, {})) {
    any = true;
    UsbCompletion completion;
    completion.id = id;
    completion.outcome = UsbOutcome::kError;
    finish(completion);
  }
  return any;
}

void HostPort::finish(UsbCompletion& completion) {
  const auto found = under_way_.find(completion.id);
  if (found != under_way_.end()) {
    const Done done = std::move(found->second);
    under_way_.erase(found);
    done(completion);
  }
}

std::optional<Bytes> HostPort::control(const Setup& setup, Bytes data) {
  const bool to_host = (setup[0] & 0x80U) != 0;
  bool ended = false;
  std::optional<Bytes> answer;
  UsbTransfer transfer;
  transfer.endpoint = to_host ? 0x80 : 0;
  transfer.setup = setup;
  transfer.length = to_host ? static_cast<std::size_t>(setup[6] | setup[7] << 8U) : 0;
  transfer.data = std::move(data);
  const std::uint64_t id = submit(std::move(transfer), [&](UsbCompletion& completion) {
    ended = true;
    if (completion.outcome == UsbOutcome::kDone) {
      answer = std::move(completion.data);
    }
  });
  const std::uint64_t give_up = peripheral_.now_us() + 2'000'000;
  while (!ended && !hung && peripheral_.now_us() < give_up) {
    const std::uint64_t wake = peripheral_.run_ready();
    if (!dispatch()) {
      peripheral_.advance_to(std::min(wake, give_up));
    }
  }
  if (!ended) {
    cancel(id);
    dispatch();
    under_way_.erase(id);
  }
  return answer;
}

std::string HostPort::string_descriptor(std::uint8_t index) {
  if (index == 0) {
    return "";
  }
  const std::optional<Bytes> found =
      control(setup_packet(0x80, kGetDescriptor, static_cast<std::uint16_t>(0x0300U | index), kEnglish, 255));
  std::string text;
  // The strings of our devices are Latin; sysfs would show UTF-8.
  for (std::size_t k = 2; found && k + 1 < found->size() && k + 1 < at(*found, 0); k += 2) {
    text.push_back(static_cast<char>(at(*found, k)));
  }
  return text;
}

std::optional<Enumerated> HostPort::enumerate(std::uint8_t address) {
  const std::optional<Bytes> head = control(setup_packet(0x80, kGetDescriptor, 0x0100, 0, 64));
  if (!head || head->size() < 8 || !control(setup_packet(0, 5, address, 0, 0))) {
    return std::nullopt;
  }
  std::optional<Bytes> device = control(setup_packet(0x80, kGetDescriptor, 0x0100, 0, 18));
  const std::optional<Bytes> start = control(setup_packet(0x80, kGetDescriptor, 0x0200, 0, 9));
  if (!device || device->size() != 18 || !start || start->size() != 9) {
    return std::nullopt;
  }
  const auto total = static_cast<std::uint16_t>(at(*start, 2) | at(*start, 3) << 8U);
  std::optional<Bytes> configuration = control(setup_packet(0x80, kGetDescriptor, 0x0200, 0, total));
  if (!configuration) {
    return std::nullopt;
  }
  Enumerated result;
  result.device = std::move(*device);
  result.configuration = std::move(*configuration);
  result.interfaces = interfaces_of(result.configuration);
  const auto string_at = [&](std::size_t field) {
    return string_descriptor(static_cast<std::uint8_t>(at(result.device, field)));
  };
  result.manufacturer = string_at(14);
  result.product = string_at(15);
  result.serial = string_at(16);
  if (!control(setup_packet(0, 9, static_cast<std::uint16_t>(at(result.configuration, 5)), 0, 0))) {
    return std::nullopt;
  }
  return result;
}

}  // namespace scatter::mock_bus
