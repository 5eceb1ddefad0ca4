#include "tests/usb/mock_bus/slot.h"

#include <poll.h>

#include <algorithm>
#include <utility>

#include <fmt/format.h>

namespace scatter::mock_bus {

Slot::Slot(Testbed& testbed, Tally& tally, const BusConditions& conditions,
           std::unique_ptr<Peripheral> peripheral, int number)
    : testbed_(testbed),
      tally_(tally),
      conditions_(conditions),
      peripheral_(std::move(peripheral)),
      host_(*peripheral_),
      pace_(peripheral_->clock_mode()),
      number_(number) {}

void Slot::plug(unsigned speed_mbps) {
  host_.hung = false;
  host_.powerless = false;
  speed_mbps_ = speed_mbps;
  peripheral_->port().plug(speed_mbps == 480 ? simulator::UsbBusSpeed::kHigh : simulator::UsbBusSpeed::kFull);
  run();
}

void Slot::unplug() {
  peripheral_->port().unplug();
  run();
}

void Slot::cut_power() {
  peripheral_->port().unplug();
  host_.powerless = true;
  leaves_at_ = std::chrono::steady_clock::now() + kHubNotices;
  host_.dispatch();
}

void Slot::leave() {
  if (device_ != nullptr) {
    host_.dispatch();
    device_->leave();
    left_.push_back(std::move(device_));
  }
}

void Slot::enumerate() {
  seen_joins_ = peripheral_->port().joins();
  const unsigned address = next_address_;
  // The kernel counts to 127 before it gives an address anew.
  next_address_ = next_address_ == 127 ? 2 : next_address_ + 1;
  std::optional<Enumerated> enumerated = host_.enumerate(static_cast<std::uint8_t>(address));
  if (!enumerated) {
    if (peripheral_->port().present()) {
      tally_.violate("a device on the bus cannot be enumerated");
    }
    return;
  }
  BusDevice::Place place;
  place.bus = static_cast<unsigned>(number_ + 1);
  place.port = fmt::format("{}-1", place.bus);
  place.address = address;
  place.speed_mbps = speed_mbps_;
  device_ = std::make_unique<BusDevice>(testbed_, host_, tally_, conditions_, std::move(*enumerated),
                                        std::move(place));
}

void Slot::run() {
  if (leaves_at_ && std::chrono::steady_clock::now() >= *leaves_at_) {
    leaves_at_.reset();
    leave();
  }
  do {
    if (!host_.hung) {
      wake_us_ = peripheral_->run_ready();
    }
  } while (host_.dispatch());
  const simulator::UsbPort& port = peripheral_->port();
  const bool current = port.present() && port.joins() == seen_joins_;
  if (device_ != nullptr && !leaves_at_ && (!current || device_->gone())) {
    leave();
  }
  if (device_ == nullptr && port.present() && port.joins() != seen_joins_ && !host_.hung) {
    enumerate();
  }
}

bool Slot::serve() {
  bool did = device_ != nullptr && device_->serve();
  for (const auto& left : left_) {
    did = left->serve() || did;
  }
  std::erase_if(left_, [](const auto& left) { return left->finished(); });
  return did;
}

void Slot::release_held() {
  if (device_ != nullptr) {
    device_->release_held();
  }
  for (const auto& left : left_) {
    left->release_held();
  }
}

void Slot::add_waits(std::vector<pollfd>& files) const {
  if (device_ != nullptr) {
    device_->add_waits(files);
  }
  for (const auto& left : left_) {
    left->add_waits(files);
  }
}

bool Slot::slow() const {
  return peripheral_->port().host_is_slow() || (device_ != nullptr && device_->program_is_slow());
}

std::uint64_t Slot::wait_us() {
  std::uint64_t longest = 1'000'000;
  if (leaves_at_) {
    longest = 1000;
  }
  if (host_.hung) {
    return longest;
  }
  return std::min(longest, pace_.wait_us(peripheral_->now_us(), wake_us_, slow()));
}

void Slot::passed() {
  if (host_.hung) {
    return;
  }
  if (const std::optional<std::uint64_t> now = pace_.time_after_wait()) {
    peripheral_->advance_to(*now);
  }
}

}  // namespace scatter::mock_bus
