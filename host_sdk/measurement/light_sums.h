// Running merge of the frames of every illumination: a recording of any length in bounded memory.
#pragma once

#include <cstdint>
#include <map>
#include <vector>

#include "host_sdk/measurement/frame_batch.h"
#include "host_sdk/measurement/references.h"
#include "protocol/descriptor.h"

namespace scatter::measurement {

inline constexpr std::uint8_t kLedOff = 0xFF;

/// Rates per pixel of each illumination, merged batch by batch.
///
/// Batches are averaged with the used exposure time (times monitor) of each pixel as weight: that
/// depends on the light only through the choice of exposures, so it does not bias the mean.
class LightSums {
 public:
  struct Planes {
    RateImage image;             ///< Of what was added so far; variance infinity: saturated throughout.
    std::vector<float> weight;   ///< Used exposure time times monitor [s V].
    double inverse_monitor = 0;  ///< Mean of 1 / monitor over the frames [1/V].
    std::size_t frames = 0;
  };

  /// Merges one batch. A batch holds whole sweeps: the short exposures of an illumination decide
  /// where the long ones of the same sweep are used.
  /// Cost  parallel over pixels.
  void add(const FrameBatch& batch, const DarkModel& dark, const protocol::SensorInfo& sensor);

  /// Null when nothing was added for it.
  [[nodiscard]] const Planes* find(std::uint8_t illumination) const noexcept;

 private:
  std::map<std::uint8_t, Planes> planes_;
};

}  // namespace scatter::measurement
