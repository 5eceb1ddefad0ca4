// Calibration sessions: place the references, average their frames, keep the result.
#pragma once

#include <chrono>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "host_sdk/error/error.h"
#include "host_sdk/measurement/geometry.h"
#include "host_sdk/measurement/references.h"
#include "protocol/types.h"

namespace scatter::device {
class Device;
}

namespace scatter::measurement {

struct CalibrateOptions {
  Geometry geometry = Geometry::kReflection;
  /// Called when a person must place something; returns false to give up. Not called when the
  /// instrument has a reference stage. Empty: without a stage calibration fails and says so.
  std::function<bool(const std::string& instruction)> ask_user;
  /// Progress 0..1 and what is going on.
  std::function<void(double fraction, const std::string& what)> progress;
  std::stop_token stop;
};

struct Calibration {
  std::shared_ptr<const ReferenceSet> references;
  double instrument_seconds = 0;
  double wall_seconds = 0;
};

/// Runs dark, reference and black steps, commits the manifests to the device.
/// Errors   kFailedPrecondition: a reference could not be placed; kAborted; device errors.
[[nodiscard]] Result<Calibration> calibrate(device::Device& device, const CalibrateOptions& options);

/// Writes a calibration as a recording (`.scat`) that process() and `--calibration` take.
[[nodiscard]] Status save(const ReferenceSet& references, const std::filesystem::path& file);

/// Reads a calibration file, or the copy that a measurement recording carries.
[[nodiscard]] Result<std::shared_ptr<const ReferenceSet>> load_references(const std::filesystem::path& file);

/// Folder of one instrument in the calibration library: $SCATTER_LIBRARY, else
/// $XDG_DATA_HOME/openscatter, else ~/.local/share/openscatter; then calibrations/SERIAL.
[[nodiscard]] std::filesystem::path library_folder(const std::string& serial);

}  // namespace scatter::measurement
