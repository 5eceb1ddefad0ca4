// Configure, start, drain: one run of a recipe on a live device.
#pragma once

#include <functional>
#include <stop_token>

#include "host_sdk/device/device.h"
#include "host_sdk/device/recording_writer.h"
#include "host_sdk/error/error.h"
#include "protocol/types.h"

namespace scatter::measurement {

/// Sees every frame, complete or not; a failed Status ends the run and is returned.
using FrameSink = std::function<Status(const device::Frame& frame, double fraction)>;

/// Runs a recipe to its end. On any error or stop the device is left stopped.
/// Errors  of the device, the recorder and the sink; kAborted; kDeadlineExceeded when nothing comes
///         for 5 s beyond the longest exposure.
[[nodiscard]] Result<device::RunSummary> run_recipe(device::Device& device, const protocol::Recipe& recipe,
                                                    device::RecordingWriter* recorder,
                                                    const std::stop_token& stop, const FrameSink& sink);

}  // namespace scatter::measurement
