// One measurement on a live device: make sure of the calibration, record, process.
#pragma once

#include <filesystem>

#include "host_sdk/measurement/calibrate.h"
#include "host_sdk/measurement/process.h"

namespace scatter::measurement {

struct MeasureOptions {
  std::optional<Geometry> geometry;  ///< Empty: transmission when its module is mounted, else reflection.
  std::filesystem::path recording;   ///< Where the raw frames go; written while measuring.
  std::shared_ptr<const ReferenceSet>
      references;           ///< Given calibration; empty: the device's current one, else calibrate.
  bool use_library = true;  ///< Look for and keep calibrations in library_folder().
  bool calibrate_if_needed = true;
  std::uint32_t time_budget_ms = 0;        ///< 0 = 5 s.
  std::uint16_t repeats = 0;               ///< Sweeps; 0 = 3.
  std::optional<protocol::Recipe> recipe;  ///< Instead of the standard one.
  ProcessOptions process;
  CalibrateOptions calibrate;  ///< geometry is overridden; progress and stop are used for the run, too.
};

struct MeasureResult {
  std::optional<Calibration> calibration;  ///< Set when this call calibrated.
  /// Empty when no calibration could be had: then `uncalibrated` says why and what to do, the raw
  /// frames are recorded, and quality has the row "calibration_missing".
  std::optional<Measurement> measurement;
  std::optional<Error> uncalibrated;
  std::vector<QualityItem> quality;  ///< The measurement's, or that one row.
  protocol::Ledger ledger;
  double instrument_seconds = 0;  ///< Device clock, start to end of the run.
  double wall_seconds = 0;        ///< Recording and processing, without calibration.
};

/// The standard recipe for a descriptor.
[[nodiscard]] protocol::Recipe standard_recipe(const protocol::Descriptor& descriptor,
                                               const MeasureOptions& options);

/// Only records (no calibration needed); the recording carries the references if given.
[[nodiscard]] Result<protocol::Ledger> record(device::Device& device, const MeasureOptions& options);

/// Calibrates when needed, records, processes. After any error the recording so far stays readable
/// and the device is stopped.
/// Errors   kAborted; device and file errors. A missing calibration is a result, not an error.
[[nodiscard]] Result<MeasureResult> measure(device::Device& device, const MeasureOptions& options);

}  // namespace scatter::measurement
