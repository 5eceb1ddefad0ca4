// How a recording carries a calibration: two attachments.
#pragma once

#include <memory>
#include <string_view>

#include "host_sdk/device/recording_reader.h"
#include "host_sdk/device/recording_writer.h"
#include "host_sdk/measurement/references.h"

namespace scatter::measurement {

inline constexpr std::string_view kAttachmentReferences =
    "calibration/references";  ///< ReferenceSet::serialise().
inline constexpr std::string_view kAttachmentCalibrationId = "calibration/sha256";  ///< Its 32-byte SHA-256.

[[nodiscard]] Status attach(device::RecordingWriter& writer, const ReferenceSet& references);

/// Null when the recording carries no calibration. Damage is covered by the recording's checksums.
[[nodiscard]] Result<std::shared_ptr<const ReferenceSet>> attached_references(
    const device::RecordingReader& reader);

}  // namespace scatter::measurement
