// A measurement's recording: its frames merged as they are read, and what is known of them.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "host_sdk/error/error.h"
#include "host_sdk/measurement/frame_batch.h"
#include "host_sdk/measurement/light_sums.h"
#include "host_sdk/measurement/references.h"
#include "protocol/descriptor.h"
#include "protocol/types.h"

namespace scatter::device {
class RecordingReader;
}

namespace scatter::measurement {

/// One or more runs of a sample through one window. Descriptor, hot pixels and references are
/// cropped to the window, so that everything downstream sees a sensor of the window's size.
struct RecordedScan {
  protocol::Descriptor descriptor;
  std::vector<std::uint32_t> hot_pixels;
  protocol::Recipe recipe;
  std::shared_ptr<const ReferenceSet> references;
  std::vector<FrameRecord> frames;  ///< Complete ones, in order of time.
  LightSums light;
  protocol::Ledger ledger;
  std::size_t damaged_frames = 0;  ///< Incomplete or corrupt, not used.
  std::string integrity;           ///< What is wrong with the file, "" when nothing.
  double instrument_seconds = 0;
  std::uint64_t creation_unix_ns = 0;
  std::size_t raw_bytes = 0;
  std::string id;  ///< SHA-256 (hex) over the metadata and pixel checksums of all frames.
};

/// Opens the recording and prepares a scan without frames. `given` takes the place of the calibration
/// that the recording carries.
/// Errors  of recording_reader.h; kDataLoss: no run of a sample; kInvalidArgument: runs with different
///         windows, or a calibration of another instrument; kFailedPrecondition: no calibration.
[[nodiscard]] Result<RecordedScan> open_scan(const device::RecordingReader& reader, const std::string& name,
                                             const std::shared_ptr<const ReferenceSet>& given);

/// Reads all frames into the scan; merging runs beside reading. Memory stays bounded: frames are
/// dropped once a few sweeps of them are merged.
/// Errors  kDataLoss: no complete frame.
[[nodiscard]] Status read_frames(const device::RecordingReader& reader, const std::string& name,
                                 RecordedScan& scan);

/// Descriptor of the window of a recipe as a sensor of its own.
[[nodiscard]] protocol::Descriptor cropped(const protocol::Descriptor& descriptor,
                                           const protocol::Recipe& recipe);

/// The same window of a calibration. Errors  kInvalidArgument: other sensor size or serial.
[[nodiscard]] Result<std::shared_ptr<const ReferenceSet>> cropped(
    const std::shared_ptr<const ReferenceSet>& references, const protocol::Descriptor& full,
    const protocol::Recipe& recipe);

}  // namespace scatter::measurement
