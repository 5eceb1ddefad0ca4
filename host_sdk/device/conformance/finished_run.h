// A run from its configuration to its end, with all frames.
#pragma once

#include <vector>

#include "host_sdk/device/conformance/subject.h"

namespace scatter::conformance {

struct FinishedRun {
  device::Configured configured;
  std::vector<device::Frame> frames;
  device::RunSummary summary;
};

/// Errors  those of configure, start and next; a run that delivers nothing for 10 s, or lasts longer than 50
/// s,
///         is aborted (kDeadlineExceeded).
[[nodiscard]] Result<FinishedRun> run_to_end(device::Device& device, const protocol::Recipe& recipe,
                                             const Subject& subject,
                                             const device::StartOptions& options = {});

}  // namespace scatter::conformance
