// Where a result comes from, as text for file headers.
#pragma once

#include <map>
#include <string>

#include "host_sdk/measurement/process.h"
#include "host_sdk/measurement/recorded_scan.h"

namespace scatter::measurement {

/// Version of this software, for example "OpenScatter 0.1.0".
[[nodiscard]] std::string software_version();

/// Keys: recording_id, calibration_id, software, instrument, serial, created (ISO 8601, UTC),
/// settings (exposures, repeats, target), certificates, tilt_correction.
[[nodiscard]] std::map<std::string, std::string> provenance(const RecordedScan& scan,
                                                            const Tilt* corrected_tilt);

/// ISO 8601, UTC, seconds: "2026-01-01T00:00:00Z".
[[nodiscard]] std::string iso_time(std::uint64_t unix_s);

}  // namespace scatter::measurement
