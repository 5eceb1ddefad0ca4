// The frames of a recording, sorted by what they show: the input of processing.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "host_sdk/device/frame.h"
#include "host_sdk/error/error.h"
#include "host_sdk/measurement/exposure_merge.h"
#include "host_sdk/measurement/references.h"
#include "protocol/descriptor.h"
#include "protocol/messages.h"

namespace scatter::measurement {

/// Frame metadata next to its counts.
struct ScanFrame {
  protocol::FrameBegin begin;
  protocol::FrameEnd end;
  Exposure exposure;
};

/// All frames of one illumination, exposures ascending, within one exposure in order of time.
struct IlluminationFrames {
  std::uint8_t illumination = 0;
  std::vector<ScanFrame> frames;
  [[nodiscard]] std::vector<Exposure> exposures() const;
};

/// One or more runs of one target and one window. Descriptor and hot pixels are cropped to the
/// window, so that everything downstream sees a sensor of the window's size.
struct RecordedScan {
  protocol::Descriptor descriptor;
  std::vector<std::uint32_t> hot_pixels;
  protocol::Recipe recipe;
  std::vector<IlluminationFrames> lit;
  std::vector<ScanFrame> off;  ///< LED off, sorted by exposure.
  protocol::Ledger ledger;
  std::size_t damaged_frames = 0;  ///< Incomplete or corrupt, not used.
  std::string integrity;           ///< What is wrong with the file, "" when nothing.
  double instrument_seconds = 0;
  std::uint64_t creation_unix_ns = 0;
  std::size_t raw_bytes = 0;
  std::string id;  ///< SHA-256 (hex) over the metadata and pixel checksums of all frames.

  std::vector<device::Frame> keep_alive;             ///< Owners of Mono16 pixels.
  std::vector<std::vector<std::uint16_t>> unpacked;  ///< Pixels that came packed.
};

struct LoadedRecording {
  RecordedScan scan;
  protocol::Descriptor full;                       ///< Of the whole sensor.
  std::shared_ptr<const ReferenceSet> references;  ///< The copy in the recording, cropped; null when none.
};

/// Monitor reading [V] with the photodiode's own temperature slope taken out.
[[nodiscard]] double monitor_volts(const protocol::Descriptor& descriptor,
                                   const protocol::FrameBegin& begin) noexcept;

/// Reads all runs of `target` from a recording.
/// Errors  of recording_reader.h; kDataLoss: no complete frame of that target;
///         kInvalidArgument: runs with different windows.
[[nodiscard]] Result<LoadedRecording> load_recording(const std::filesystem::path& file,
                                                     protocol::Target target);

/// Files one frame into the scan. False: not complete, counted as damaged.
bool add_frame(RecordedScan& scan, const protocol::Descriptor& full, device::Frame frame);

/// Puts every list into its documented order; call once after the last add_frame.
void sort_frames(RecordedScan& scan);

/// Descriptor of the window of a recipe as a sensor of its own.
[[nodiscard]] protocol::Descriptor cropped(const protocol::Descriptor& descriptor,
                                           const protocol::Recipe& recipe);

/// The same window of a calibration. Errors  kInvalidArgument: other sensor size or serial.
[[nodiscard]] Result<std::shared_ptr<const ReferenceSet>> cropped(
    const std::shared_ptr<const ReferenceSet>& references, const protocol::Descriptor& full,
    const protocol::Recipe& recipe);

}  // namespace scatter::measurement
