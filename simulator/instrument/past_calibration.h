// Gives a fresh instrument the memory of a calibration that is past its life.
#pragma once

#include "host_sdk/error/error.h"

namespace scatter::simulator {

class VirtualInstrument;

/// Commits manifests through the firmware's own calibration session, as an earlier host would have
/// done, then lets the instrument stand unused until they have expired by age. Their frames exist
/// nowhere, as when the earlier host was another computer.
/// Errors    kInternal: the firmware refused a step (the message says which).
[[nodiscard]] Status hold_past_calibration(VirtualInstrument& instrument);

}  // namespace scatter::simulator
