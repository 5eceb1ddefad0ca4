// Step 6: reference. From merged frames to f per pixel, all illuminations side by side.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "host_sdk/measurement/exposure_merge.h"
#include "host_sdk/measurement/pixel_geometry.h"
#include "host_sdk/measurement/recorded_scan.h"
#include "host_sdk/measurement/references.h"
#include "host_sdk/reflectance/direction.h"

namespace scatter::measurement {

/// One illumination on its way through the processing: "lane" = place in the interleaved images.
struct Lane {
  std::uint8_t illumination = 0;
  std::uint8_t head = 0;
  std::uint8_t channel = 0;
  reflectance::Direction omega_i;  ///< Instrument frame, mirrored to the upper hemisphere for transmission.
  double f_reference_per_sr = 0;   ///< White tile's f_w or the translucent standard's.
  double f_black_per_sr = 0;
  double u_reference = 0;  ///< Relative standard uncertainties of both.
  double u_black = 0;
  double monitor_relative_variance = 0;  ///< Of S / W, common to all pixels.
  const LightSums::Planes* light = nullptr;
  std::vector<float> exposures_s_v;  ///< Distinct exposures times monitor, ascending.
  const ReferenceImages* references = nullptr;
};

/// f per pixel and lane: index pixel * lanes + lane. Variance infinity: no value (saturated).
struct LaneImages {
  std::vector<float> f_per_sr;
  std::vector<float> variance;
};

struct LaneSelection {
  std::vector<Lane> lanes;  ///< Sorted by head, then channel; heads with all channels only.
  bool transmission = false;
  std::vector<std::string> omitted;  ///< Heads left out, with the reason.
};

/// Which illuminations of a scan can be processed with a calibration. Scans with both kinds of
/// illumination give the reflection part.
[[nodiscard]] LaneSelection select_lanes(const RecordedScan& scan);

/// f = f_b + (f_w - f_b) (S - B) / (W - B) with its variance from those of S, B and W.
/// Cost  one pass over all frames, parallel over pixels.
[[nodiscard]] LaneImages lane_images(const RecordedScan& scan, const LaneSelection& selection);

/// Drops the eight neighbours of every usable pixel without value: the edge of a saturated spot (a
/// mirror image of the source, the direct beam through a film) falls partly into them.
void spread_saturation(LaneImages& images, const PixelGeometry& geometry, std::size_t lanes);

}  // namespace scatter::measurement
