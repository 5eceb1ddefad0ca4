#include "host_sdk/device/usb/usb_transport.h"

#include <chrono>

namespace scatter::device::usb {
namespace {

BulkLink::Clock::time_point real(TimePoint time) {
  return BulkLink::Clock::time_point(
      std::chrono::duration_cast<BulkLink::Clock::duration>(time.time_since_epoch()));
}

}  // namespace

Result<std::span<const std::byte>> UsbTransport::receive(TimePoint deadline, const std::stop_token& stop) {
  return link_->receive(real(deadline), stop);
}

Status UsbTransport::write(std::span<const std::byte> bytes, TimePoint deadline,
                           const std::stop_token& stop) {
  return link_->write(bytes, real(deadline), stop);
}

TimePoint UsbTransport::now() const {
  return TimePoint(std::chrono::duration_cast<Duration>(BulkLink::Clock::now().time_since_epoch()));
}

std::uint64_t UsbTransport::system_time_unix_ns() const {
  return static_cast<std::uint64_t>(
      std::chrono::duration_cast<Duration>(std::chrono::system_clock::now().time_since_epoch()).count());
}

}  // namespace scatter::device::usb
