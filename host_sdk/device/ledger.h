// The two halves of the loss ledger put together.
#pragma once

#include <algorithm>
#include <cstdint>

#include "protocol/types.h"

namespace scatter::device {

/// The device knows what it exposed, what the sensor and what it dropped itself; the host knows what
/// arrived whole. What was sent and did not arrive whole is the link's. A device that claims fewer
/// exposures than frames arrived gets lost_link = 0 and a ledger that does not balance.
[[nodiscard]] constexpr protocol::Ledger completed_ledger(const protocol::Ledger& device_half,
                                                          std::uint64_t delivered, std::uint64_t lost_host,
                                                          std::uint64_t corrupt) noexcept {
  protocol::Ledger out;
  out.exposed = device_half.exposed;
  out.lost_sensor = device_half.lost_sensor;
  out.lost_firmware = device_half.lost_firmware;
  out.delivered = delivered;
  out.lost_host = lost_host;
  out.corrupt = corrupt;
  const std::uint64_t known = out.lost_sensor + out.lost_firmware + delivered + lost_host + corrupt;
  out.lost_link = out.exposed > known ? out.exposed - known : 0;
  return out;
}

}  // namespace scatter::device
