// What a link has lost, as the status tells it.
#pragma once

#include "firmware/ports/ports.h"
#include "protocol/link_decoder.h"
#include "protocol/messages.h"

namespace scatter::firmware {

/// Adds what a decoder counted.
inline void count(const protocol::LinkCounters& counters, protocol::DeviceStatus& status) noexcept {
  status.frames_bad_header += counters.bad_header + counters.bad_length;
  status.frames_bad_payload += counters.bad_payload;
  status.bytes_skipped += counters.skipped_bytes;
}

/// What the core's decoder and the carrier below it have met since boot.
inline void count_damage(const protocol::LinkCounters& decoder, Link& link,
                         protocol::DeviceStatus& status) noexcept {
  status.frames_good = decoder.good;
  count(decoder, status);
  if (const protocol::LinkCounters* carrier = link.dropped()) {
    count(*carrier, status);
  }
}

}  // namespace scatter::firmware
