// Steps 1, 3 and 5 of instrument.md section 4 for one illumination: dark, HDR merge, monitor.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "host_sdk/measurement/references.h"
#include "protocol/descriptor.h"

namespace scatter::measurement {

/// One frame of an illumination, whole sensor, counts.
struct Exposure {
  std::span<const std::uint16_t> dn;
  double exposure_s = 0;
  double monitor_v = 1;  ///< LED monitor, corrected for its temperature; 1 for LED-off frames.
  std::int32_t sensor_temperature_mK = 0;
};

/// Turns counts into electrons: black level, gain, linearity (descriptor.h SensorInfo).
class SensorResponse {
 public:
  explicit SensorResponse(const protocol::SensorInfo& sensor) noexcept;

  /// Electrons of a signal of `dn` counts above the black level.
  [[nodiscard]] float electrons(float dn) const noexcept {
    const float q = dn * gain_;
    const float u = c_over_well_ * q;
    // Series of the inverse of q_m = q (1 + c q / w) to third order; |c| <= 0.02 leaves 1e-7.
    return q * (1.0F - u * (1.0F - u * (2.0F - 5.0F * u)));
  }
  [[nodiscard]] float gain_e_per_dn() const noexcept { return gain_; }
  /// Read noise and quantisation, electrons squared.
  [[nodiscard]] float read_variance_e2() const noexcept { return read_variance_; }
  [[nodiscard]] float full_well_e() const noexcept { return full_well_; }
  /// Counts at and above this are saturated.
  [[nodiscard]] std::uint16_t saturation_dn() const noexcept { return saturation_dn_; }
  /// An exposure is used where the shorter ones predict less than this many electrons.
  [[nodiscard]] float usable_e() const noexcept { return usable_; }

 private:
  float gain_;
  float c_over_well_;
  float read_variance_;
  float full_well_;
  float usable_;
  std::uint16_t saturation_dn_;
};

/// Dark current's growth from the model's temperature to `temperature_mK`.
[[nodiscard]] double dark_growth(const protocol::SensorInfo& sensor, const DarkModel& dark,
                                 std::int32_t temperature_mK) noexcept;

/// Ascending, repeats (which differ by the monitor's reading only, under 5 %) once.
[[nodiscard]] std::vector<float> distinct_exposures(std::vector<float> exposures_s_v);

/// Where a merge writes; all of equal size.
struct MergedPixels {
  std::span<float> rate;      ///< [e-/s per volt]; 0 where even the shortest exposure is saturated.
  std::span<float> variance;  ///< Of rate; infinity there.
  std::span<float> weight;    ///< Exposure time times monitor of the frames used [s V]; 0 there.
};

/// Merges the exposures of one illumination for the pixels [first, first + out.rate.size()).
///
/// Estimator  weighted mean of e_k / (t_k m_k) with weights 1 / variance predicted from the pooled
///            rate, so that the weights do not follow each frame's own noise (which would bias the
///            mean low). A frame is used for a pixel when the shorter exposures of its neighbours
///            predict less than 90 % of full well: choosing by the pixel's own noise would bias it.
/// Shape      frames sorted by exposure_s.
/// Threads    any; scratch of a fixed size.
void merge_exposures(std::span<const Exposure> frames, const DarkModel& dark,
                     const protocol::SensorInfo& sensor, std::size_t first, const MergedPixels& out);

}  // namespace scatter::measurement
