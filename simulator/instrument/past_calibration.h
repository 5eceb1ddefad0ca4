// Gives a fresh instrument the memory of a calibration that is past its life.
#pragma once

#include <cstdint>

#include "host_sdk/error/error.h"
#include "protocol/descriptor.h"

namespace scatter::simulator {

class VirtualInstrument;

/// How long an instrument stands unused until every calibration is past its life.
[[nodiscard]] std::uint64_t past_life_us(const protocol::Descriptor& descriptor) noexcept;

/// Commits manifests through the firmware's own calibration session, as an earlier host would have
/// done, then lets the instrument stand unused until they have expired by age. Their frames exist
/// nowhere, as when the earlier host was another computer.
/// Errors    kInternal: the firmware refused a step (the message says which).
[[nodiscard]] Status hold_past_calibration(VirtualInstrument& instrument);

}  // namespace scatter::simulator
