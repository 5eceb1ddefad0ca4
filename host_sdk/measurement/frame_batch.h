// Frames with their pixels, sorted by what they show: as many as are merged at one time.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "host_sdk/device/frame.h"
#include "host_sdk/measurement/exposure_merge.h"
#include "protocol/descriptor.h"
#include "protocol/messages.h"

namespace scatter::measurement {

/// What is kept of a frame after its pixels are merged.
struct FrameRecord {
  protocol::FrameBegin begin;
  protocol::FrameEnd end;
  double exposure_s = 0;
  double monitor_v = 1;  ///< Corrected for temperature; 1 for LED-off frames.
  /// Mean counts above black of every 7th pixel, each limited to the saturation level: equal for
  /// frames of equal light and exposure.
  double level_dn = 0;
};

/// Monitor reading [V] with the photodiode's own temperature slope taken out.
[[nodiscard]] double monitor_volts(const protocol::Descriptor& descriptor,
                                   const protocol::FrameBegin& begin) noexcept;

class FrameBatch {
 public:
  /// Files one frame. nullopt: it is not complete and is left out.
  [[nodiscard]] std::optional<FrameRecord> add(const protocol::Descriptor& descriptor, device::Frame frame);

  /// Frames of one illumination (0xFF: LED off), exposures ascending, then by age.
  struct Group {
    std::uint8_t illumination = 0xFF;
    std::vector<Exposure> exposures;
  };
  [[nodiscard]] std::vector<Group> groups() const;

  [[nodiscard]] std::size_t bytes() const noexcept { return bytes_; }
  [[nodiscard]] bool empty() const noexcept { return entries_.empty(); }

 private:
  struct Entry {
    std::uint8_t illumination;
    std::uint32_t exposure_us;
    std::size_t age;
    Exposure exposure;
  };
  std::vector<Entry> entries_;
  std::vector<device::Frame> keep_alive_;             ///< Owners of Mono16 pixels.
  std::vector<std::vector<std::uint16_t>> unpacked_;  ///< Pixels that came packed.
  std::size_t bytes_ = 0;
};

}  // namespace scatter::measurement
