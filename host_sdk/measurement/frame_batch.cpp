#include "host_sdk/measurement/frame_batch.h"

#include <algorithm>
#include <tuple>

namespace scatter::measurement {

double monitor_volts(const protocol::Descriptor& d, const protocol::FrameBegin& begin) noexcept {
  const double kelvin = 1e-3 * (begin.led_temperature_mK - d.sensor.reference_temperature_mK);
  return 1e-6 * begin.monitor_uv / (1.0 + static_cast<double>(d.monitor_slope_per_K) * kelvin);
}

std::optional<FrameRecord> FrameBatch::add(const protocol::Descriptor& descriptor, device::Frame frame) {
  if (frame.status != device::FrameStatus::kComplete || frame.pixel_count() == 0) {
    return std::nullopt;
  }
  const bool lit = frame.begin.kind == protocol::FrameKind::kLight;
  FrameRecord record{frame.begin, frame.end, 1e-6 * frame.begin.exposure_us,
                     lit ? monitor_volts(descriptor, frame.begin) : 1.0, 0};
  Entry entry{lit ? frame.begin.illumination : std::uint8_t{0xFF},
              frame.begin.exposure_us,
              entries_.size(),
              {{}, record.exposure_s, record.monitor_v, frame.begin.sensor_temperature_mK}};
  if (frame.begin.pixel_format == protocol::PixelFormat::kMono16) {
    entry.exposure.dn = {reinterpret_cast<const std::uint16_t*>(frame.bytes().data()), frame.pixel_count()};
    bytes_ += frame.size_bytes;
    keep_alive_.push_back(std::move(frame));
  } else {
    std::vector<std::uint16_t> pixels(frame.pixel_count());
    if (!device::unpack(frame, pixels)) {
      return std::nullopt;
    }
    bytes_ += pixels.size() * sizeof(std::uint16_t);
    entry.exposure.dn = unpacked_.emplace_back(std::move(pixels));
  }
  const SensorResponse response(descriptor.sensor);
  double sum = 0;
  std::size_t count = 0;
  for (std::size_t p = 0; p < entry.exposure.dn.size(); p += 7, ++count) {
    sum += std::min(entry.exposure.dn[p], response.saturation_dn());
  }
  record.level_dn = sum / static_cast<double>(count) - static_cast<double>(descriptor.sensor.black_level_dn);
  entries_.push_back(entry);
  return record;
}

std::vector<FrameBatch::Group> FrameBatch::groups() const {
  std::vector<Entry> sorted = entries_;
  std::ranges::sort(sorted, {},
                    [](const Entry& e) { return std::tuple(e.illumination, e.exposure_us, e.age); });
  std::vector<Group> out;
  for (const Entry& entry : sorted) {
    if (out.empty() || out.back().illumination != entry.illumination) {
      out.push_back({entry.illumination, {}});
    }
    out.back().exposures.push_back(entry.exposure);
  }
  return out;
}

}  // namespace scatter::measurement
