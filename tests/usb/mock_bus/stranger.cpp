#include "tests/usb/mock_bus/stranger.h"

#include <algorithm>
#include <array>
#include <string_view>
#include <utility>

#include "firmware/core/step.h"
#include "protocol/usb_identity.h"

namespace scatter::mock_bus {

using simulator::UsbCompletion;
using simulator::UsbOutcome;
using simulator::UsbTransfer;

namespace {

constexpr std::uint8_t low(std::uint16_t word) {
  return static_cast<std::uint8_t>(word & 0xFFU);
}
constexpr std::uint8_t high(std::uint16_t word) {
  return static_cast<std::uint8_t>(word >> 8U);
}

constexpr std::array<std::uint8_t, 18> kDevice{18,
                                               1,
                                               0x00,
                                               0x02,
                                               0,
                                               0,
                                               0,
                                               64,
                                               low(protocol::usb::kVendorId),
                                               high(protocol::usb::kVendorId),
                                               low(protocol::usb::kProductId),
                                               high(protocol::usb::kProductId),
                                               0x34,
                                               0x12,
                                               1,
                                               2,
                                               3,
                                               1};
// USB 2.0, tables 9-10, 9-12 and 9-13. Subclass 0x42 is not ours.
constexpr std::array<std::uint8_t, 32> kConfiguration{
    9, 2, 32, 0, 1,    1, 0,    0x80, 50, 9, 4, 0,    0, 2,    0xFF, 0x42,
    1, 0, 7,  5, 0x81, 2, 0x00, 0x02, 0,  7, 5, 0x02, 2, 0x00, 0x02, 0};

constexpr std::array<std::string_view, 4> kStrings{"", "Somebody Else", "Thermostat", "T1000"};

Bytes string_descriptor(std::uint8_t index) {
  Bytes bytes{std::byte{0}, std::byte{3}};
  if (index == 0) {
    bytes.insert(bytes.end(), {std::byte{0x09}, std::byte{0x04}});
  } else {
    for (const char letter : kStrings.at(index)) {
      bytes.insert(bytes.end(), {static_cast<std::byte>(letter), std::byte{0}});
    }
  }
  bytes[0] = static_cast<std::byte>(bytes.size());
  return bytes;
}

template <std::size_t size>
Bytes bytes_of(const std::array<std::uint8_t, size>& from) {
  Bytes bytes(size);
  std::transform(from.begin(), from.end(), bytes.begin(), [](std::uint8_t each) { return std::byte{each}; });
  return bytes;
}

}  // namespace

std::uint64_t Stranger::run_ready() {
  for (const UsbTransfer& transfer : std::exchange(under_way_, {})) {
    if ((transfer.endpoint & 0x7FU) == 0) {
      answer(transfer);
    } else {
      under_way_.push_back(transfer);
    }
  }
  return now_us_ + firmware::kLongestSleepUs;
}

void Stranger::answer(const UsbTransfer& transfer) {
  const auto& [type, request, index, kind, index_low, index_high, length_low, length_high] = transfer.setup;
  Bytes data;
  if (type == 0x80 && request == 6 && kind == 1) {
    data = bytes_of(kDevice);
  } else if (type == 0x80 && request == 6 && kind == 2) {
    data = bytes_of(kConfiguration);
  } else if (type == 0x80 && request == 6 && kind == 3 && index < kStrings.size()) {
    data = string_descriptor(index);
  } else if ((type & 0xE0U) != 0) {
    end(transfer.id, UsbOutcome::kStalled);
    return;
  }
  data.resize(std::min(data.size(), transfer.length));
  end(transfer.id, UsbOutcome::kDone, std::move(data));
}

void Stranger::end(std::uint64_t id, UsbOutcome outcome, Bytes data) {
  UsbCompletion completion;
  completion.id = id;
  completion.outcome = outcome;
  completion.actual = data.size();
  completion.data = std::move(data);
  done_.push_back(std::move(completion));
}

void Stranger::end_all(UsbOutcome outcome) {
  for (const UsbTransfer& transfer : std::exchange(under_way_, {})) {
    end(transfer.id, outcome);
  }
}

void Stranger::plug(simulator::UsbBusSpeed /*speed*/) {
  plugged_ = true;
  ++joins_;
}

void Stranger::unplug() {
  plugged_ = false;
  end_all(UsbOutcome::kGone);
}

void Stranger::submit(UsbTransfer transfer) {
  under_way_.push_back(std::move(transfer));
  if (!plugged_) {
    end_all(UsbOutcome::kGone);
  }
}

bool Stranger::cancel(std::uint64_t id) {
  const auto found = std::find_if(under_way_.begin(), under_way_.end(),
                                  [&](const UsbTransfer& each) { return each.id == id; });
  if (found == under_way_.end()) {
    return false;
  }
  under_way_.erase(found);
  end(id, UsbOutcome::kCancelled);
  return true;
}

std::optional<UsbCompletion> Stranger::next_completion() {
  if (done_.empty()) {
    return std::nullopt;
  }
  UsbCompletion completion = std::move(done_.front());
  done_.pop_front();
  return completion;
}

}  // namespace scatter::mock_bus
