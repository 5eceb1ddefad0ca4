// The checks of instrument.md section 6 on one processed measurement.
#pragma once

#include <optional>
#include <vector>

#include "host_sdk/measurement/lanes.h"
#include "host_sdk/measurement/process.h"
#include "host_sdk/measurement/recorded_scan.h"
#include "host_sdk/measurement/tilt_fit.h"

namespace scatter::measurement {

/// Everything the checks look at; nothing is changed.
struct QualityInput {
  const RecordedScan& scan;
  const LaneSelection& selection;
  const reflectance::GridBrdf& brdf;
  const std::vector<AlbedoRow>& albedo;
  const std::optional<TiltFit>& tilt;
  bool tilt_corrected = false;
};

[[nodiscard]] std::vector<QualityItem> quality_report(const QualityInput& input);

}  // namespace scatter::measurement
